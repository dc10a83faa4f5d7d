"""What is marked to be cut out of the recording, and how far the file is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.elements import ON_PICK, bar, escape, panel
from app.html.moment import Moment
from app.html.units import count
from app.state.view_state import Limits, ViewState
from app.views.recording.state import Excerpt, RecordingState, excerpt_of

if TYPE_CHECKING:
    from app.engine.jobs import JobResult


def excerpt_html(moment: Moment, state: ViewState, result: JobResult | None) -> str:
    """The timeline's marks, what lies between them, and the button that makes a file of it."""
    title, view = "<h4>Trim</h4>", state.of(RecordingState)
    if view.cut is not None and (result is None or not result.trouble):
        share = 0.0 if result is None else result.share
        lag = f'<div class="et-lag"><span>trimming, {share:.0%}</span>{bar(share)}</div>'
        return panel("cut", title, lag, _button("drop", "Cancel"))
    excerpt = excerpt_of(state, Limits(moment.recording.sensor, moment.windows, moment.recording.span.start))
    marks = _mark("a", "A here (I)") + _mark("b", "B here (O)")
    cut = _button("trim", "Trim and download", "et-strong") if excerpt is not None else ""
    trouble = ""
    if view.cut is not None and result is not None:
        trouble = f'<div class="et-failed" role="alert">{escape(result.trouble)}</div>'
    said = "Mark A and B on the timeline: what lies between them." if excerpt is None else _said(moment, excerpt)
    note = f'<div class="et-note">{said}</div>'
    return panel("cut", title, f'<div class="et-chips">{marks}{cut}</div>', note, trouble)


def _said(moment: Moment, excerpt: Excerpt) -> str:
    recording = moment.recording
    begin, end = ((stamp - recording.span.start) / 1e6 for stamp in excerpt.span)
    frames = ", with the camera’s frames" if recording.ground_truth is not None else ""
    where = f"{begin:.3f} s … {end:.3f} s"
    num = count(max(excerpt.stop - excerpt.start, 0))
    return f"{where}, {num} events{frames}; an HDF5 file (event_utils), timestamps as they are."


def _mark(word: str, text: str) -> str:
    return f'<button class="et-button" data-k="timeline:{word}" {ON_PICK}>{text}</button>'


def _button(word: str, text: str, classes: str = "") -> str:
    return f'<button class="et-button {classes}" data-k="recording:{word}" {ON_PICK}>{text}</button>'
