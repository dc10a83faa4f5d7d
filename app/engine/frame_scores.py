"""How good a frame is: against the camera frame of its moment, or by itself. Known values are kept for all who ask."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.evaluation.evaluate import Judges

Rule = Literal["paper", "evreal"]
"""A protocol of `etnet.evaluation`, by name; its module needs torch."""
Values = Mapping[str, float]
"""Measure → value. "mse", "ssim", "lpips" only where there is a camera frame to hold against."""


def frame_values(
    loaded: LoadedPlayback,
    request: FrameRequest,
    index: int,
    rule: Rule,
    frame: int | None,
    cancelled: Callable[[], bool],
) -> tuple[Values, bool]:
    """A window's values, and whether they had to be found now."""
    request = replace(request, index=index, wants_attention=False)
    made: list[Values] = []

    def make() -> Values:
        made.append(_judged(loaded, request, rule, frame, cancelled))
        return made[0]

    values = loaded.scores.get((request, loaded.contract, rule, frame), make, lambda values: 64 * len(values))
    return values, bool(made)


def _judged(
    loaded: LoadedPlayback, request: FrameRequest, rule: Rule, frame: int | None, cancelled: Callable[[], bool]
) -> Values:
    import torch

    from etnet.evaluation.evaluate import FrameJudge
    from etnet.evaluation.lpips import MIN_SIDE
    from etnet.evaluation.metrics import contrast, sharpness
    from etnet.evaluation.protocol import PROTOCOLS

    playback, intervention = loaded.playing(request)
    raw = playback.frame(request.index, intervention)
    if raw is None:
        raw = playback.at(request.index, None, intervention, cancelled).frame
    judge = FrameJudge(PROTOCOLS[rule], judges())
    with torch.inference_mode():
        image = judge.prepare(raw.float().cpu(), getattr(playback.model, "post_processing", "none"))
        target = None if frame is None else _target(loaded, frame)
        if target is None or target.shape != image.shape or min(image.shape[-2:]) < MIN_SIDE:
            return {"sharpness": sharpness(image).item(), "contrast": contrast(image).item()}
        return {str(name): value for name, value in judge.score(image, target, judge.features(target)).items()}


def _target(loaded: LoadedPlayback, frame: int) -> Tensor:
    import torch

    truth = loaded.playback.recording.ground_truth
    assert truth is not None
    return torch.from_numpy(np.ascontiguousarray(truth.read_frame(frame), np.float32))[None, None]


@cache
def judges() -> Judges:
    """What frames are scored by, loaded once."""
    from etnet.evaluation.evaluate import Judges

    return Judges.default()
