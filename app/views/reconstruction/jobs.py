"""The variance that a network estimates for each pixel of its frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.reconstruction.state import ReconstructionState

SLOT = "reconstruction.variance"


@dataclass(frozen=True, slots=True)
class VarianceJob:
    """A job: the variance map of one frame; `None` of a network that estimates none."""

    request: FrameRequest

    def run(
        self, loaded: LoadedPlayback, cancelled: Callable[[], bool]
    ) -> Iterator[tuple[Float32[np.ndarray, "h w"] | None, float]]:
        """One answer."""
        playback, intervention = loaded.playing(self.request)
        step = playback.at(self.request.index, None, intervention, cancelled)
        yield None if step.variance is None else step.variance[0, 0].float().cpu().numpy(), 1.0


def reconstruction_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """Asked while the variance is looked at."""
    if state.of(ReconstructionState).shows != "variance":
        return {}
    return {SLOT: VarianceJob(replace(request, wants_attention=False))}
