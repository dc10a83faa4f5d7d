"""Curves over the time of some windows; a click goes to its moment, one on a named curve chooses what it is of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.html.elements import ON_PICK, escape
from app.html.units import seconds

_WIDTH, _HEIGHT = 1000, 200


@dataclass(frozen=True, slots=True)
class Line:
    """One curve. `name` is said of it where it is pointed at; a click on it then sends `key`."""

    values: Sequence[float]
    is_loud: bool = False
    name: str = ""
    key: str = ""


def chart(
    times: Sequence[float],
    lines: Sequence[Line],
    ends: tuple[float, float],
    top: str,
    *,
    index: int | None = None,
    said: str = "",
    even: float | None = None,
    testid: str = "",
) -> str:
    """`times` in seconds, one for each window; `ends`: the lowest and the highest value, of which `top` is said.

    `index` is the place of the current window among them, `said` what is said of it; a dashed line stands at `even`.
    """
    first, last = times[0], max(times[-1], times[0] + 1e-6)
    low, high = ends
    drawn = "".join(_drawn(line, times, (first, last), (low, high)) for line in lines)
    if even is not None:
        y = _HEIGHT * (1 - (even - low) / (high - low))
        drawn += f'<polyline points="0,{y:.1f} {_WIDTH},{y:.1f}" class="et-even"></polyline>'
    now = ""
    if index is not None:
        at = 100 * (times[index] - first) / (last - first)
        now = f'<i class="et-head-line" style="left:{at:.2f}%"></i>'
    now += f'<span class="et-chart-high" data-testid="curve-now">{escape(said)}</span>' if said else ""
    named = f' data-testid="{testid}"' if testid else ""
    return (
        f'<div class="et-chart et-pick et-over-time" data-k="span:{first:.6f},{last:.6f}" {ON_PICK}{named}'
        f' title="Click to go there"><svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none">{drawn}</svg>'
        f'{now}<span class="et-chart-low">{escape(seconds(first))}</span>'
        f'<span class="et-chart-low et-chart-end">{escape(seconds(last))}</span>'
        f'<span class="et-chart-high et-chart-end">{escape(top)}</span></div>'
    )


def _drawn(line: Line, times: Sequence[float], span: tuple[float, float], ends: tuple[float, float]) -> str:
    first, last = span
    low, high = ends
    points = " ".join(
        f"{_WIDTH * (t - first) / (last - first):.1f},{_HEIGHT * (1 - (float(v) - low) / (high - low)):.1f}"
        for t, v in zip(times, line.values, strict=True)
    )
    curve = f'<polyline points="{points}" class="{"et-loud" if line.is_loud else ""}"></polyline>'
    if not line.key:
        return curve
    # A line is too thin to be hit: a wider one that is not seen lies over it.
    return (
        f'<g data-k="{escape(line.key)}" {ON_PICK} data-testid="curve"><title>{escape(line.name)}</title>{curve}'
        f'<polyline points="{points}" class="et-hit"></polyline></g>'
    )
