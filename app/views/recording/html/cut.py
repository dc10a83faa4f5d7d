"""What is marked to be cut out of the recording, and how far the file is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.elements import ON_PICK, escape, panel
from app.html.moment import Moment
from app.html.units import count
from app.views.recording.state import RecordingState

if TYPE_CHECKING:
    from app.engine.jobs import JobResult


def excerpt_html(moment: Moment, view: RecordingState, result: JobResult | None) -> str:
    """Two marks, what lies between them, and the button that makes a file of it."""
    title = "<h4>Trim</h4>"
    if view.cut is not None and (result is None or not result.trouble):
        share = 0.0 if result is None else result.share
        bar = f'<div class="et-bar"><i style="width:{share:.0%}"></i></div>'
        lag = f'<div class="et-lag"><span>trimming, {share:.0%}</span>{bar}</div>'
        return panel("cut", title, lag, _button("drop", "Cancel"))
    marks = _button("from", "From here") + _button("to", "To here")
    is_marked = view.excerpt.is_marked and view.excerpt.recording_id == moment.recording_id
    cut = _button("trim", "Trim and download", "et-strong") if is_marked else ""
    trouble = ""
    if view.cut is not None and result is not None:
        trouble = f'<div class="et-failed" role="alert">{escape(result.trouble)}</div>'
    said = _said(moment, view) if is_marked else "Go to a window and mark it as the first or the last one."
    note = f'<div class="et-note">{said}</div>'
    return panel("cut", title, f'<div class="et-chips">{marks}{cut}</div>', note, trouble)


def _said(moment: Moment, view: RecordingState) -> str:
    recording, begin, end = moment.recording, view.excerpt.begin, view.excerpt.end
    first, last = (0 if begin is None else begin.event), (recording.num_events if end is None else end.event)
    at = 0.0 if begin is None else (begin.stamp - recording.span.start) / 1e6
    to = (recording.span.stop if end is None else end.stamp) - recording.span.start
    frames = ", with the camera’s frames" if recording.ground_truth is not None else ""
    where = f"{at:.3f} s … {to / 1e6:.3f} s"
    return f"{where}, {count(max(last - first, 0))} events{frames}; an HDF5 file (event_utils), stamps as they are."


def _button(word: str, text: str, classes: str = "") -> str:
    return f'<button class="et-button {classes}" data-k="recording:{word}" {ON_PICK}>{text}</button>'
