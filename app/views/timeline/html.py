"""The timeline: event rate, what is cached, camera frames and seconds, all in the slider's own measure."""

from __future__ import annotations

from collections.abc import Sequence

from app.html.elements import escape, panel
from app.html.moment import ARRAYS, Moment
from app.html.timeline_marks import Cached, NothingCached, curve_of, plan_of
from app.html.units import count, of_whole, rate, seconds
from etnet.render.timeline import RateCurve, area_path, frame_ticks, second_ticks

_WIDTH, _HEIGHT = 1000, 44
_FLOOR = 34
"""Below it lie the bars of what is cached."""
_MAX_TICKS = 300


def timeline_html(moment: Moment, cached: Cached | None = None, *, inset: str = "0px", over: str = "") -> str:
    """A strip of 44 px over its seconds; its width is windows 0 … n − 1. A click sends `time`.

    `inset` is left free on either side (a slider's own padding). `over`: SVG in the strip's measure, drawn last.
    """
    curve, num = curve_of(moment), len(moment.windows)
    held = cached or NothingCached()
    at = moment.index / max(num - 1, 1)
    strip = (
        f'<div class="et-strip" data-testid="strip">'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">'
        f"{_background(moment, curve, num)}{_bars(held, num)}{over}</svg>"
        f'<i class="et-head-line" style="left:{at:.3%}"></i></div>'
    )
    return panel("timeline", strip, _seconds(moment, curve, num), style=f"--inset:{inset}")


def now_html(moment: Moment) -> str:
    """The moment in numbers: its time large, then window, span, events and their rate."""
    num = len(moment.windows)
    start, stop = moment.seconds
    window = moment.window
    partial = " · last, not full" if window.is_partial else ""
    speed = rate(window.num_events / max(window.t_stop - window.t_start, 1) * 1e6)
    line = (
        f'<div class="et-now"><b data-testid="time">{seconds(stop)}</b>'
        f'<span data-testid="window">window {count(moment.index)} of {count(num)}{partial}{_so_far(moment)}</span>'
        f"<span>{seconds(start)} – {seconds(stop)}</span>"
        f"<span>{count(window.num_events)} events</span><span>{speed}</span></div>"
    )
    return panel("now", line)


def _so_far(moment: Moment) -> str:
    """That only a part of the file is on show, and how far its index is."""
    growth = moment.recording.growth
    if growth is None:
        return ""
    indexed = f"{of_whole(growth.share)} of the file indexed, more follows"
    return f'<span class="et-so-far et-warning"> · only its beginning: {indexed}</span>'


def _background(moment: Moment, curve: RateCurve, num: int) -> str:
    """The parts of the drawing that do not move: made once."""

    def make() -> str:
        path = area_path(curve, num, _WIDTH, _FLOOR - 6)
        truth = moment.recording.ground_truth
        ticks = ""
        if truth is not None and 0 < len(truth) <= _MAX_TICKS:
            marks = [index / max(num - 1, 1) * _WIDTH for index in frame_ticks(truth.stamps, curve)]
            ticks = "".join(f"M{x:.1f} 0V5" for x in marks)
        # Its own drawing order: the curve first, the camera's ticks hang from the top edge.
        return (
            f'<path d="{path}" transform="translate(0 6)" fill="#8f98a3"/>'
            f'<path d="{ticks}" stroke="#ffffff" stroke-width="1" vector-effect="non-scaling-stroke"/>'
        )

    return ARRAYS.get(("strip", *plan_of(moment)), make, len)


def _bars(held: Cached, num: int) -> str:
    states = _boxes(held.states, num, _FLOOR + 2, 4, "#5f8f78")
    frames = _boxes(held.frames, num, _FLOOR + 2, 8, "#86e3b0")
    return f"{states}{frames}"


def _boxes(ranges: Sequence[range], num: int, y: int, height: int, colour: str) -> str:
    unit = _WIDTH / max(num - 1, 1)
    return "".join(
        f'<rect x="{(r.start - 0.5) * unit:.1f}" y="{y}" width="{max(len(r) * unit, 1.5):.1f}" height="{height}"'
        f' fill="{colour}"/>'
        for r in ranges
    )


def _seconds(moment: Moment, curve: RateCurve, num: int) -> str:
    ticks = second_ticks(curve, moment.recording.span.start)
    step = ticks[1][1] - ticks[0][1] if len(ticks) > 1 else 1.0
    digits = max(0, min(3, -int(f"{step:e}".split("e")[1])))
    labels = [_tick(index / max(num - 1, 1), seconds(t, digits)) for index, t in ticks]
    return f'<div class="et-seconds">{"".join(labels)}</div>'


def _tick(at: float, text: str) -> str:
    side = "et-tick-first" if at < 0.03 else "et-tick-last" if at > 0.97 else "et-tick"
    return f'<span class="{side}" style="left:{at:.2%}">{escape(text)}</span>'


def timeline_key_html(moment: Moment) -> str:
    """What the colours of the strip mean."""
    truth = moment.recording.ground_truth
    frames = '<span class="et-swatch"><i style="background:#fff;width:2px;border-radius:0"></i>camera frames</span>'
    key = (
        '<div class="et-swatches">'
        '<span class="et-swatch"><i style="background:#8f98a3;border-radius:2px"></i>events per second</span>'
        '<span class="et-swatch"><i style="background:#86e3b0;border-radius:2px"></i>images ready</span>'
        '<span class="et-swatch"><i style="background:#5f8f78;border-radius:2px"></i>memory ready</span>'
        f"{frames if truth is not None and 0 < len(truth) <= _MAX_TICKS else ''}</div>"
    )
    return panel("timeline-key", key)
