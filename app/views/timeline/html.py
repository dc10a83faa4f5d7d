"""The timeline's HTML: the strip with what is cached, its scale in seconds, and the buttons that move along it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from app.catalogue.cut import is_live
from app.html.elements import ON_PICK, escape, icon, icon_button, panel, segmented
from app.html.moment import ARRAYS, Moment
from app.html.timeline_marks import (
    AXIS_WIDTH,
    Cached,
    NothingCached,
    axis_of,
    curve_of,
    place_of,
    places_of,
    plan_of,
    seconds_of,
    span_of,
)
from app.html.units import count, of_whole, rate, seconds
from app.state.view_state import ViewState
from app.views.timeline.state import SPEEDS, speed_of
from etnet.render.timeline import MICROSECONDS, nice_step

_HEIGHT = 44
_FLOOR = 36
"""Below it lies the lane of what is cached."""
_LANE = 5
_MAX_TICKS = 400
MAX_TRIGGERS = 300
"""Ticks that a click jumps to; more are drawn without."""
_NUM_SECONDS = 8


def timeline_html(
    moment: Moment,
    cached: Cached | None = None,
    state: ViewState | None = None,
    *,
    approximate: range = range(0),
    changed: range = range(0),
    over: str = "",
) -> str:
    """A strip of 44 px over its seconds. Dragging along it sends `span:from,to` in seconds.

    `approximate` and `changed` are the windows that are so; `over` is SVG in the strip's measure, drawn last.
    """
    window, (start, stop) = moment.window, seconds_of(moment)
    left, right = place_of(moment, window.t_start), place_of(moment, window.t_stop)
    now = f'<rect x="{left:.2f}" y="0" width="{max(right - left, 1):.2f}" height="{_FLOOR}" fill="#ffffff2e"/>'
    lane = _lane(moment, cached or NothingCached(), approximate, changed)
    strip = (
        '<div class="et-strip" data-testid="strip">'
        f'<div class="et-axis" data-k="span:{span_of(moment)}" data-drag="1"'
        f' data-of="{escape(moment.recording_id)}" data-start="{start:.6f}" data-duration="{stop - start:.6f}"'
        f" {ON_PICK}>{_between(moment, state)}"
        f'<svg viewBox="0 0 {AXIS_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f"{_background(moment)}{now}{lane}{over}</svg>{_triggers(moment)}"
        f'<i class="et-head-line" style="--x:{right / AXIS_WIDTH:.3%}"></i>{_marks(moment, state)}'
        f"{_seconds(moment)}</div></div>"
    )
    return panel("timeline", strip)


def _background(moment: Moment) -> str:
    """The parts of the drawing that do not move: made once."""

    def make() -> str:
        curve = curve_of(moment)
        truth, triggers = moment.recording.ground_truth, moment.recording.triggers
        frames = "" if truth is None else _ticks(moment, _on_axis(moment, truth.stamps), 0, 4)
        pulses = "" if triggers is None else _ticks(moment, _on_axis(moment, triggers.stamps), 0, 8)
        return (
            f'<path d="{_area(moment, curve.stamps, curve.rates)}" fill="#4b5160"/>'
            f'<path d="{frames}" stroke="#aab0bd" stroke-width="1" vector-effect="non-scaling-stroke"/>'
            f'<path d="{pulses}" stroke="var(--accent)" stroke-width="1.5" vector-effect="non-scaling-stroke"/>'
        )

    return ARRAYS.get(("strip", *plan_of(moment), axis_of(moment)), make, len)


def _on_axis(moment: Moment, stamps: np.ndarray) -> np.ndarray:
    """Those of a live recording that the axis still shows; all of any other."""
    if not is_live(moment.recording):
        return stamps
    axis = axis_of(moment)
    first, last = np.searchsorted(stamps, [axis.start, axis.stop + 1])
    return stamps[first:last]


def _ticks(moment: Moment, stamps: np.ndarray, top: int, bottom: int) -> str:
    """Upright lines at stamps, thinned evenly where there are very many."""
    step = max(1, -(-len(stamps) // _MAX_TICKS))
    return "".join(f"M{x:.1f} {top}V{bottom}" for x in places_of(moment, stamps[::step]))


def _triggers(moment: Moment) -> str:
    """A target above each trigger: a click jumps there."""
    triggers = moment.recording.triggers
    if triggers is None or not 0 < len(triggers) <= MAX_TRIGGERS:
        return ""
    start, words = moment.recording.span.start, {1: " rising", -1: " falling", 0: ""}
    targets = []
    for stamp, channel, edge in zip(triggers.stamps, triggers.channels, triggers.edges, strict=True):
        at = (int(stamp) - start) / MICROSECONDS
        title = f"Trigger, input {channel}{words.get(int(edge), '')}, {seconds(max(at, 0.0))}"
        place = place_of(moment, float(stamp)) / AXIS_WIDTH
        targets.append(
            f'<b class="et-trigger" data-k="goto:{at:.6f}" {ON_PICK} title="{title}" style="left:{place:.3%}"></b>'
        )
    return "".join(targets)


def _between(moment: Moment, state: ViewState | None) -> str:
    """The stretch between the marks, behind everything."""
    if state is None or (state.mark_a is None and state.mark_b is None):
        return ""
    span = moment.recording.span
    left = place_of(moment, span.start if state.mark_a is None else state.mark_a) / AXIS_WIDTH
    right = place_of(moment, span.stop if state.mark_b is None else state.mark_b) / AXIS_WIDTH
    return f'<i class="et-between" style="left:{left:.3%};width:{right - left:.3%}"></i>'


def _marks(moment: Moment, state: ViewState | None) -> str:
    """Handles that are dragged along the axis."""
    if state is None:
        return ""
    return "".join(
        f'<b class="et-mark" data-k="mark:{name}:{span_of(moment)}" data-drag="1" {ON_PICK}'
        f' title="{name.upper()}: drag it, or set it here with the key {key}"'
        f' style="left:{place_of(moment, stamp) / AXIS_WIDTH:.3%}">{name.upper()}</b>'
        for name, key, stamp in (("a", "I", state.mark_a), ("b", "O", state.mark_b))
        if stamp is not None
    )


def _area(moment: Moment, stamps: np.ndarray, rates: np.ndarray) -> str:
    """The event rate as an area that stands on the floor."""
    if len(stamps) == 0:
        return ""
    top, height = max(float(rates.max()), 1e-9), _FLOOR - 8
    xs, ys = places_of(moment, stamps), (_FLOOR - height * rates / top).tolist()
    line = " ".join(f"L{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True))
    return f"M0 {_FLOOR} L0 {ys[0]:.1f} {line} L{xs[-1]:.1f} {_FLOOR} Z"


def _lane(moment: Moment, held: Cached, approximate: range, changed: range) -> str:
    """What the engine holds of each window, and where the network is changed."""
    top = _FLOOR + 2
    cold = f'<rect x="0" y="{top}" width="{AXIS_WIDTH}" height="{_LANE}" fill="var(--cold)"/>'
    lanes = (
        _boxes(moment, held.states, top, _LANE, "var(--kept)"),
        _boxes(moment, held.frames, top, _LANE, "var(--exact)" if held.is_exact else "var(--kept)"),
        _boxes(moment, (approximate,), top, _LANE, "var(--warning)"),
        _boxes(moment, (changed,), _FLOOR - 2, 3, "var(--accent-strong)"),
    )
    return cold + "".join(lanes)


def _boxes(moment: Moment, ranges: Sequence[range], y: int, height: int, colour: str) -> str:
    boxes = []
    last = len(moment.windows) - 1
    for held in ranges:
        if len(held) == 0 or held.start > last:
            continue
        left = place_of(moment, moment.windows[held.start].t_start)
        right = place_of(moment, moment.windows[min(held.stop - 1, last)].t_stop)
        if right <= 0:
            continue  # it has left a live recording
        width = max(right - left, 1.5)
        boxes.append(f'<rect x="{left:.1f}" y="{y}" width="{width:.1f}" height="{height}" fill="{colour}"/>')
    return "".join(boxes)


def _seconds(moment: Moment) -> str:
    """Labels at round times since the first event."""
    start, stop = seconds_of(moment)
    duration = stop - start
    if duration <= 0:
        return ""
    step = nice_step(duration, _NUM_SECONDS)
    digits = max(0, min(3, -int(f"{step:e}".split("e")[1])))
    first, last = math.ceil(start / step - 1e-9), math.floor(stop / step + 1e-9)
    labels = [_tick((i * step - start) / duration, seconds(i * step, digits)) for i in range(first, last + 1)]
    return f'<div class="et-seconds">{"".join(labels)}</div>'


def _tick(at: float, text: str) -> str:
    side = "et-tick-first" if at < 0.01 else "et-tick-last" if at > 0.985 else "et-tick"
    return f'<span class="{side}" style="left:{at:.2%}">{escape(text)}</span>'


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
