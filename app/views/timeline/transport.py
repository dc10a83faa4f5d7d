"""What stands beside the strip: buttons to move and play, the moment in numbers, speed, marks, the legend."""

from __future__ import annotations

from app.html.elements import ON_PICK, escape, icon, icon_button, panel, segmented
from app.html.moment import Moment
from app.html.units import count, of_whole, rate, seconds
from app.state.view_state import ViewState
from app.views.timeline.state import SPEEDS, speed_of
from etnet.render.timeline import MICROSECONDS


def transport_html(state: ViewState, runs: bool | None = None) -> str:
    """First, previous, play, next, last, loop. `runs`: it plays, or follows a live source."""
    playing = state.is_playing if runs is None else runs
    words = "Pause (space)" if playing else "Play (space)"
    play = (
        f'<button class="etv-play" data-k="timeline:play" {ON_PICK} title="{words}" aria-label="{words}">'
        f"{icon('pause' if playing else 'play')}</button>"
    )
    where = "between A and B" if state.mark_a is not None or state.mark_b is not None else "the recording"
    loop = icon_button(
        f"timeline:{'once' if state.loops else 'loop'}", "loop", f"Loop {where} (I sets A, O sets B)", is_on=state.loops
    )
    return (
        '<div class="etv-transport" role="group" aria-label="Playback">'
        f"{icon_button('timeline:first', 'first', 'First window (Home)')}"
        f"{icon_button('timeline:back', 'previous', 'Previous window (←)')}{play}"
        f"{icon_button('timeline:on', 'next', 'Next window (→)')}"
        f"{icon_button('timeline:last', 'last', 'Last window (End)')}{loop}</div>"
    )


def now_html(moment: Moment) -> str:
    """The moment in numbers: its time large, then window, span and event rate."""
    num = len(moment.windows)
    start, stop = moment.seconds
    window = moment.window
    partial = " · last, not full" if window.is_partial else ""
    speed = rate(window.num_events / max(window.t_stop - window.t_start, 1) * 1e6)
    which = f"window {count(moment.index)} <i>of 0 – {count(max(num - 1, 0))}</i>{partial}{_so_far(moment)}"
    line = (
        f'<div class="et-now"><b data-testid="time" title="Click to type a time">{seconds(stop)}</b>'
        f'<span data-testid="window">{which}</span>'
        f"<span>{seconds(start)} – {seconds(stop)}</span><span>{speed}</span></div>"
    )
    return panel("now", line)


def _so_far(moment: Moment) -> str:
    """That only a part of the file is open, and how far its index is."""
    growth = moment.recording.growth
    if growth is None:
        return ""
    indexed = f"{of_whole(growth.share)} of the file indexed, more follows"
    return f'<span class="et-so-far et-warning"> · only its beginning: {indexed}</span>'


def speed_html(state: ViewState) -> str:
    """How fast it plays."""
    chosen = speed_of(state.speed, state.waits_for_frames)
    options = {f"timeline:speed {name}": name for name in SPEEDS}
    return segmented("Speed, of real time", options, f"timeline:speed {chosen}")


def marks_html(moment: Moment, state: ViewState) -> str:
    """The stretch between the marks, and the way to take them away; nothing while there is none."""
    if state.mark_a is None and state.mark_b is None:
        return ""
    span = moment.recording.span
    begin = span.start if state.mark_a is None else state.mark_a
    end = span.stop if state.mark_b is None else state.mark_b
    words = f"{seconds((begin - span.start) / MICROSECONDS)} – {seconds((end - span.start) / MICROSECONDS)}"
    clear = icon_button("timeline:clear", "close", "Clear the marks (U)")
    return f'<span class="etv-marks" data-testid="marks"><b>A–B</b> {escape(words)}{clear}</span>'


def legend_html(moment: Moment, *, is_approximate: bool, is_changed: bool, measure: str = "") -> str:
    """What the colours of the strip mean: those that are there."""
    recording = moment.recording
    truth, triggers = recording.ground_truth, recording.triggers
    entries = [
        ("#7d8595", "event rate", "et-dot"),
        ("#fff", measure, "et-dot"),
        ("var(--exact)", "exact", "et-dot"),
        ("var(--kept)", "state kept", "et-dot"),
        ("var(--cold)", "cold", "et-dot"),
        ("var(--warning)", "approximate" if is_approximate else "", "et-dot"),
        ("var(--accent-strong)", "intervention on" if is_changed else "", "et-dot"),
        ("#aab0bd", "camera frames" if truth is not None and len(truth) else "", "et-line"),
        ("var(--accent)", "triggers" if triggers is not None and len(triggers) else "", "et-line"),
    ]
    listed = "".join(
        f'<span class="et-swatch"><i class="{shape}" style="background:{colour}"></i>{escape(words)}</span>'
        for colour, words, shape in entries
        if words
    )
    key = icon_button("timeline:legend", "info", "Legend")
    return f'<span class="etv-key" data-testid="timeline-key">{key}<span class="et-swatches">{listed}</span></span>'
