"""What the recording is like, for "why is it bad here?": measured once, while nobody waits; all who ask share it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.filter.state import STATISTICS_SLOT
from etnet.events.fitness import Fitness, measure_fitness


@dataclass(frozen=True, slots=True)
class StatisticsJob:
    """A job: the `Fitness` of the recording as it is filtered now."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Fitness, float]]:
        """What is known after each stretch."""
        yield from measure_fitness(loaded.playback.recording)


def filter_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """Asked while the tab is open."""
    return {STATISTICS_SLOT: StatisticsJob(replace(request.plain, index=0, cold_at=0))}
