"""The doctor's page of the open recording: looked through once, a block of events at a time, whoever asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from app.studies import Study
from app.studio import Stage
from app.view_state import ViewState
from app.wishes import Wish
from etnet.events.examine import Examination, look_through

SLOT = "source/doctor"


@dataclass(frozen=True, slots=True)
class DoctorStudy:
    """A study: the recording's `Examination`. It is the same for every network and for every cut into windows."""

    recording_id: str
    wish: Wish = field(compare=False)

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[Examination | None, float]]:
        """`None` until all is seen."""
        yield from look_through(stage.playback.recording)


def doctor_question(state: ViewState, wish: Wish) -> dict[str, Study]:
    """Asked while the doctor's page is open."""
    if not state.source.examines:
        return {}
    return {SLOT: DoctorStudy(state.recording_id, replace(wish.plain, index=0))}
