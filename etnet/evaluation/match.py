"""Which ground-truth frame belongs to which reconstruction: by their stamps, with an offset between the two clocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64

TOLERANCE = 1_000
"""µs that the two stamps of a pair may differ (EVREAL's bound)."""


class Pair(NamedTuple):
    """Prediction and ground-truth frame by index, and how much later the frame is, µs (offset included)."""

    prediction: int
    frame: int
    lag: int


def pair_by_stamp(
    predictions: Sequence[int] | Int64[np.ndarray, " p"],
    frames: Sequence[int] | Int64[np.ndarray, " n"],
    tolerance: int = TOLERANCE,
    offset: int = 0,
) -> list[Pair]:
    """The pairs within `tolerance` µs, in the order of time; no prediction and no frame is in two of them.

    Both lists are ascending stamps in µs. `offset` is added to the frames' stamps: what the frames' clock is behind.
    Of several predictions near one frame the nearest is taken, the earlier of two equally near.
    """
    stamps = np.asarray(predictions, np.int64)
    if len(stamps) == 0:
        return []
    nearest_to: dict[int, Pair] = {}
    for frame, stamp in enumerate(np.asarray(frames, np.int64) + offset):
        after = int(np.searchsorted(stamps, stamp))
        candidates = [i for i in (after - 1, after) if 0 <= i < len(stamps)]
        best = min(candidates, key=lambda i: abs(int(stamp - stamps[i])))
        pair = Pair(best, frame, int(stamp - stamps[best]))
        rival = nearest_to.get(best)
        if abs(pair.lag) <= tolerance and (rival is None or abs(pair.lag) < abs(rival.lag)):
            nearest_to[best] = pair
    return sorted(nearest_to.values())
