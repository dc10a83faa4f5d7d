"""The timeline: a linear axis from the recording's first event to its last, whatever the windows are.

Event rate, camera frames, what is cached and the current window stand where they are in time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from app.catalogue.cut import is_live
from app.html.elements import ON_PICK, escape, panel
from app.html.moment import ARRAYS, Moment
from app.html.timeline_marks import AXIS_WIDTH, Cached, NothingCached, axis_of, curve_of, place_of, plan_of
from app.html.units import count, of_whole, rate, seconds
from etnet.render.timeline import MICROSECONDS, nice_step

_HEIGHT = 44
_FLOOR = 34
"""Below it lie the bars of what is cached."""
_MAX_TICKS = 400
_NUM_SECONDS = 8


def timeline_html(moment: Moment, cached: Cached | None = None, *, over: str = "") -> str:
    """A strip of 44 px over its seconds. Dragging along it sends `span:from,to` in seconds.

    `over`: SVG in the strip's measure, drawn last.
    """
    window, axis = moment.window, axis_of(moment)
    duration, start = axis.duration / MICROSECONDS, (axis.start - moment.recording.span.start) / MICROSECONDS
    begin = f"{start:.6f}" if start else "0"
    left, right = place_of(moment, window.t_start), place_of(moment, window.t_stop)
    now = f'<rect x="{left:.2f}" y="0" width="{max(right - left, 1):.2f}" height="{_FLOOR}" fill="#ffffff2e"/>'
    strip = (
        '<div class="et-strip" data-testid="strip">'
        f'<div class="et-axis" data-k="span:{begin},{start + duration:.6f}" data-drag="1"'
        f' data-start="{start:.6f}" data-duration="{duration:.6f}" {ON_PICK}>'
        f'<svg viewBox="0 0 {AXIS_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f"{_background(moment)}{now}{_bars(moment, cached or NothingCached())}{over}</svg>"
        f'<i class="et-head-line" style="--x:{right / AXIS_WIDTH:.3%}"></i>{_seconds(moment)}</div></div>'
    )
    return panel("timeline", strip)


def now_html(moment: Moment) -> str:
    """The moment in numbers: its time large, then window, span, events and their rate."""
    num = len(moment.windows)
    start, stop = moment.seconds
    window = moment.window
    partial = " · last, not full" if window.is_partial else ""
    speed = rate(window.num_events / max(window.t_stop - window.t_start, 1) * 1e6)
    which = f"window {count(moment.index)} <i>of 0 – {count(max(num - 1, 0))}</i>{partial}{_so_far(moment)}"
    line = (
        f'<div class="et-now"><b data-testid="time">{seconds(stop)}</b><span data-testid="window">{which}</span>'
        f"<span>{seconds(start)} – {seconds(stop)}</span>"
        f"<span>{count(window.num_events)} events</span><span>{speed}</span></div>"
    )
    return panel("now", line)


def _so_far(moment: Moment) -> str:
    """That only a part of the file is open, and how far its index is."""
    growth = moment.recording.growth
    if growth is None:
        return ""
    indexed = f"{of_whole(growth.share)} of the file indexed, more follows"
    return f'<span class="et-so-far et-warning"> · only its beginning: {indexed}</span>'


def _background(moment: Moment) -> str:
    """The parts of the drawing that do not move: made once."""

    def make() -> str:
        curve = curve_of(moment)
        truth = moment.recording.ground_truth
        ticks = ""
        if truth is not None and len(truth):
            axis = axis_of(moment)
            first, last = (
                np.searchsorted(truth.stamps, [axis.start, axis.stop + 1]) if is_live(moment.recording) else (0, None)
            )
            shown = truth.stamps[first:last]
            places = (place_of(moment, float(stamp)) for stamp in shown[:: max(-(-len(shown) // _MAX_TICKS), 1)])
            ticks = "".join(f"M{x:.1f} 0V4" for x in places)
        return (
            f'<path d="{_area(moment, curve.stamps, curve.rates)}" fill="#4b5160"/>'
            f'<path d="{ticks}" stroke="#aab0bd" stroke-width="1" vector-effect="non-scaling-stroke"/>'
        )

    return ARRAYS.get(("strip", *plan_of(moment), axis_of(moment)), make, len)


def _area(moment: Moment, stamps: np.ndarray, rates: np.ndarray) -> str:
    """The event rate as an area that stands on the floor."""
    if len(stamps) == 0:
        return ""
    top, height = max(float(rates.max()), 1e-9), _FLOOR - 6
    points = [
        (place_of(moment, float(t)), _FLOOR - height * float(r) / top) for t, r in zip(stamps, rates, strict=True)
    ]
    line = " ".join(f"L{x:.1f} {y:.1f}" for x, y in points)
    return f"M0 {_FLOOR} L0 {points[0][1]:.1f} {line} L{points[-1][0]:.1f} {_FLOOR} Z"


def _bars(moment: Moment, held: Cached) -> str:
    states = _boxes(moment, held.states, _FLOOR + 4, 3, "var(--kept)")
    frames = _boxes(moment, held.frames, _FLOOR + 3, 5, "var(--exact)")
    return f'<rect x="0" y="{_FLOOR + 4}" width="{AXIS_WIDTH}" height="3" fill="#ffffff14"/>{states}{frames}'


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
    axis = axis_of(moment)
    duration, start = axis.duration / MICROSECONDS, (axis.start - moment.recording.span.start) / MICROSECONDS
    if duration <= 0:
        return ""
    step = nice_step(duration, _NUM_SECONDS)
    digits = max(0, min(3, -int(f"{step:e}".split("e")[1])))
    first, last = math.ceil(start / step - 1e-9), math.floor((start + duration) / step + 1e-9)
    labels = [_tick((i * step - start) / duration, seconds(i * step, digits)) for i in range(first, last + 1)]
    return f'<div class="et-seconds">{"".join(labels)}</div>'


def _tick(at: float, text: str) -> str:
    side = "et-tick-first" if at < 0.01 else "et-tick-last" if at > 0.985 else "et-tick"
    return f'<span class="{side}" style="left:{at:.2%}">{escape(text)}</span>'


def timeline_key_html(moment: Moment) -> str:
    """What the colours of the strip mean."""
    truth = moment.recording.ground_truth
    frames = '<span class="et-swatch"><i style="background:#aab0bd;width:2px;border-radius:0"></i>camera frames</span>'
    key = (
        '<div class="et-swatches">'
        '<span class="et-swatch"><i style="background:#7d8595;border-radius:2px"></i>event rate</span>'
        '<span class="et-swatch"><i style="background:var(--exact);border-radius:2px"></i>frame cached</span>'
        '<span class="et-swatch"><i style="background:var(--kept);border-radius:2px"></i>state kept</span>'
        f"{frames if truth is not None and len(truth) else ''}</div>"
    )
    return panel("timeline-key", key)
