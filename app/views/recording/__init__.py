"""The recording itself: what it is, how it is opened and cut, its statistics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.downloads import Downloaded
from app.state import intents as ask
from app.views.recording.jobs.cut import trim_jobs
from app.views.recording.jobs.recording import recording_jobs
from app.views.recording.state import RecordingState, hear, reduce_recording
from app.views.view import Card, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.recording.panel import RecordingPanel

    return RecordingPanel()


VIEW = View(
    "recording",
    "Recording",
    "DATABASE",
    RecordingState(),
    _panel,
    workspaces=frozenset({"recording"}),
    settings_in=frozenset({"recording", "inspect"}),
    cards=(Card("recording", stage=frozenset({"recording"})),),
    reduce=reduce_recording,
    intents=(ask.ShowWorkspace, ask.MarkHere, ask.PutMark, ask.ClearMarks, Downloaded),
    hear=hear,
    run_jobs=recording_jobs,
    background_jobs=trim_jobs,
)
