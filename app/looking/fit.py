"""What kind of recording this is: measured once, whoever asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from app.studies import Study
from app.studio import Stage
from app.view_state import ViewState
from app.wishes import Wish
from etnet.events.fitness import Fitness, measure_fitness

SLOT = "compare/fit"


@dataclass(frozen=True, slots=True)
class FitStudy:
    """A study: the recording's `Fitness`."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[Fitness, float]]:
        """What is known after each stretch."""
        yield from measure_fitness(stage.playback.recording)


def fit_question(state: ViewState, wish: Wish) -> dict[str, Study]:
    """Asked while its inspector is open."""
    if state.compare.inspector != "fit":
        return {}
    return {SLOT: FitStudy(replace(wish.plain, index=0))}
