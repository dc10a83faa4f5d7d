"""What the recording is like, for "why is it bad here?": measured while nobody waits; all who ask share it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from app.catalogue.amount import amount_of, latest_of
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.filter.state import STATISTICS_SLOT
from app.views.page import RunFrame
from app.views.view import NumSeen
from etnet.events.fitness import Fitness, measure_fitness


@dataclass(frozen=True, slots=True)
class StatisticsJob:
    """A job: the `Fitness` of the recording as it is filtered now."""

    request: FrameRequest
    amount: int = 0
    """How much of it there is (`amount_of`): at least that is measured."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Fitness, float]]:
        """What is known after each stretch."""
        yield from measure_fitness(latest_of(loaded.playback.recording))


def filter_jobs(state: ViewState, moment: Moment, runs: Sequence[RunFrame], num_seen: NumSeen) -> Mapping[str, Job]:
    """Asked while the tab is open, of what is there by now."""
    asked = state.recording_id, state.model_id, state.precision, moment.policy, 0
    request = FrameRequest(*asked, cleaning=state.cleaning)
    return {STATISTICS_SLOT: StatisticsJob(request, amount_of(moment.recording))}
