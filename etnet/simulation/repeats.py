"""Frames that repeat the one before: they are no pauses of the scene, but nothing in them moves."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Shaped

_SAME_MEAN, _SAME_MOST = 0.25, 16
"""Steps of 8 bits, on average and at most, by which a repeated frame may differ."""


def is_same(one: Shaped[np.ndarray, "_ _ ..."], other: Shaped[np.ndarray, "_ _ ..."], bits: int) -> bool:
    """Whether a frame repeats another, up to what an encoder changes when it stores the same picture again.

    Mean and largest difference of code values count, in steps of 8 bits. A scene that moves or fades ever so little
    changes more: a whole step in a quarter of the picture is a mean of .25, and an edge goes through many steps.
    A frame of another size repeats none.
    """
    if one.shape != other.shape:
        return False
    step = 1 << (bits - 8)
    if cv2.norm(one, other, cv2.NORM_INF) > _SAME_MOST * step:
        return False
    return cv2.norm(one, other, cv2.NORM_L1) < _SAME_MEAN * step * one.size


def told_repeats(num_repeats: int, num_frames: int, are_dropped: bool) -> list[str]:
    """What is to be said of `num_repeats` among the frames, of which `num_frames` were kept."""
    if not num_repeats:
        return []
    done = "left out" if are_dropped else "kept as they are; --drop-repeats leaves them out"
    total = num_frames + (num_repeats if are_dropped else 0)
    return [
        f"{num_repeats} of {total} frames repeat the one before (telecine, a screen recording, or a scene that rests): "
        f"{done}"
    ]
