"""The step of the network that a view of one's own asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from app.engine.jobs import Job, JobResult
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest, Ready

if TYPE_CHECKING:
    from etnet.nets.base import Step


@dataclass(frozen=True, slots=True)
class StepJob:
    """A job: the whole step of one window, with a probe of every site."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Step, float]]:
        """One answer."""
        from etnet.nets.attention import AttentionProbe

        playback, intervention = loaded.playing(self.request)
        yield playback.at(self.request.index, AttentionProbe(), intervention, cancelled), 1.0


def slot_of(view: str) -> str:
    """Where a view's step stands."""
    return f"{view}.step"


def step_in(results: Mapping[str, JobResult], view: str, ready: Ready | None) -> Step | None:
    """The step that gave a frame, if it has come."""
    result = results.get(slot_of(view))
    if result is None or ready is None or not result.is_whole or result.job.request.key != ready.request.key:
        return None
    return result.value


def step_jobs(view: str, request: FrameRequest) -> Mapping[str, Job]:
    """What is computed for a view that asks for it."""
    return {slot_of(view): StepJob(replace(request, wants_attention=False))}
