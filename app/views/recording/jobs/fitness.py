"""What kind of recording this is: measured once for as much of it as is there; all who ask share it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from app.catalogue.amount import latest_of
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.recording.state import RecordingState
from etnet.events.fitness import Fitness, measure_fitness

SLOT = "recording.fitness"


@dataclass(frozen=True, slots=True)
class FitnessJob:
    """A job: the recording's `Fitness`."""

    request: FrameRequest
    amount: int = 0
    """How much of it there is (`amount_of`): at least that is measured."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Fitness, float]]:
        """What is known after each stretch."""
        yield from measure_fitness(latest_of(loaded.playback.recording))


def fitness_jobs(state: ViewState, request: FrameRequest, amount: int = 0) -> dict[str, Job]:
    """Asked while the sensor statistics are open."""
    if not state.of(RecordingState).fits:
        return {}
    return {SLOT: FitnessJob(replace(request.plain, index=0), amount)}
