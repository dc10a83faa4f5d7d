"""The doctor's page of the open recording: looked through once, a block of events at a time; all who ask share it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from app.catalogue.amount import latest_of
from app.engine.jobs import Job
from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.recording.state import RecordingState
from etnet.events.denoise import uncleaned
from etnet.events.examine import Examination, look_through

SLOT = "recording.statistics"


@dataclass(frozen=True, slots=True)
class ExaminationJob:
    """A job: the recording's `Examination`. It is the same for every network, filter and cut into windows."""

    recording_id: str
    request: FrameRequest = field(compare=False)
    amount: int = 0
    """How much of it there is (`amount_of`): at least that is looked through."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Examination | None, float]]:
        """`None` until all is seen."""
        yield from look_through(latest_of(uncleaned(loaded.playback.recording)))


def examination_jobs(state: ViewState, request: FrameRequest, amount: int = 0) -> dict[str, Job]:
    """Asked while the doctor's page is open."""
    if not state.of(RecordingState).examines:
        return {}
    return {SLOT: ExaminationJob(state.recording_id, replace(request.plain, index=0), amount)}
