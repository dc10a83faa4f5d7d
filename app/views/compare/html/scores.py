"""Scores over time: one curve a run, and the means over the frames that all runs have, with the worst of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from app.html.elements import ON_PICK, empty, escape, panel
from app.html.moment import Moment
from app.html.timeline_marks import place_of
from app.html.units import count, rate, seconds, short
from app.views.compare.html.run import SAME_TIME
from app.views.compare.html.series import (
    ARROWS,
    BETTER_HIGH,
    TITLES,
    Series,
    common_keys,
    decimals,
    mean_over,
    worst_of,
)
from app.views.compare.state import CompareState, Measure

MEANT: tuple[Measure, ...] = ("mse", "ssim", "lpips", "temporal", "sharpness", "contrast")
"""Measures of the table of means, in its order."""
NUM_WORST = 3
_SHORT: dict[Measure, str] = {"temporal": "temporal", "sharpness": "sharpness", "contrast": "contrast"}
_WIDTH, _HEIGHT = 1000, 150


def chart_html(moment: Moment, series: Sequence[Series], view: CompareState) -> str:
    """One curve a run over the recording's time. A click goes there."""
    measure = view.measure
    columns = [each.column(measure) for each in series]
    known = [column[np.isfinite(column)] for column in columns]
    if not any(len(column) for column in known):
        return panel("chart-empty", _why_empty(moment, series, measure, view))
    span = moment.recording.span
    low, high = _ends(np.concatenate(known))
    lines = "".join(
        _line(each, column, span.start, span.stop, low, high) for each, column in zip(series, columns, strict=True)
    )
    duration = span.duration / 1e6
    at = min(max((moment.window.t_stop - span.start) / max(span.duration, 1), 0), 1)
    return (
        f'<div class="et-chart et-pick" data-k="span:0,{duration:.6f}" {ON_PICK} data-testid="chart">'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">{lines}</svg>'
        f'<span class="et-chart-high">{_value(measure, high)}</span>'
        f'<span class="et-chart-low">{_value(measure, low)}</span>'
        f'<i class="et-head-line" style="left:{at:.3%}"></i></div>'
        f'<div class="et-caption et-ends"><span>0 s</span><span>{seconds(duration, 2)}</span></div>'
    )


def chart_note(measure: Measure) -> str:
    """Which way is better, and what a click does."""
    better = {"↓": "lower is better · ", "↑": "higher is better · "}.get(ARROWS.get(measure, ""), "")
    return f"{better}click to go there"


def _ends(known: Float64[np.ndarray, " n"]) -> tuple[float, float]:
    """Lowest and highest value of the chart, with some room."""
    low, high = float(known.min()), float(known.max())
    room = (high - low) * 0.08 or 0.01
    return low - room, high + room


def _line(each: Series, column: Float64[np.ndarray, " n"], start: int, stop: int, low: float, high: float) -> str:
    is_known = np.isfinite(column)
    xs = (each.stamps[is_known] - start) / max(stop - start, 1) * _WIDTH
    ys = _HEIGHT * (1 - (column[is_known] - low) / (high - low))
    if len(xs) == 0:
        return ""
    style = f'stroke="{each.run.colour}" stroke-width="2" vector-effect="non-scaling-stroke"'
    if len(xs) == 1:
        return f'<path d="M{xs[0]:.1f} {ys[0]:.1f}h.1" {style} stroke-width="6" stroke-linecap="round"/>'
    return f'<path d="{trace(xs, ys)}" fill="none" {style} data-run="{each.run.name}"/>'


def trace(xs: Float64[np.ndarray, " n"], ys: Float64[np.ndarray, " n"]) -> str:
    """An SVG path through the points that breaks where some in between are still to come."""
    gaps = np.diff(xs)
    is_apart = np.concatenate([[True], gaps > 3 * np.median(gaps)]) if len(gaps) else np.ones(len(xs), bool)
    pairs = zip(is_apart.tolist(), xs.tolist(), ys.tolist(), strict=True)
    return " ".join(f"{'M' if apart else 'L'}{x:.1f} {y:.1f}" for apart, x, y in pairs)


def curves_over(moment: Moment, series: Sequence[Series], measure: Measure) -> str:
    """The same curves in the timeline's own measure (SVG, 1,000 wide): time across, 4 … 30 down."""
    columns = [each.column(measure) for each in series]
    known = np.concatenate([column[np.isfinite(column)] for column in columns]) if columns else np.empty(0)
    if not len(known):
        return ""
    low, high = float(known.min()), max(float(known.max()), float(known.min()) + 1e-9)
    drawn = ""
    for each, column in zip(series, columns, strict=True):
        is_known = np.isfinite(column)
        xs = np.array([place_of(moment, float(t)) for t in each.stamps[is_known]])
        path = trace(xs, 30 - 26 * (column[is_known] - low) / (high - low))
        # A dark edge below it: the curve of the event rate is light.
        for hue, width, mark in (("#101216", 4, ""), (each.run.colour, 1.5, f' data-run="{each.run.name}"')):
            line = f'stroke="{hue}" stroke-width="{width}" vector-effect="non-scaling-stroke"'
            drawn += f'<path d="{path}" fill="none" {line}{mark}/>'
    return drawn


def _why_empty(moment: Moment, series: Sequence[Series], measure: Measure, view: CompareState) -> str:
    troubles = [each.trouble for each in series if each.trouble]
    if troubles and len(troubles) == len(series):
        return empty("Cannot be scored", troubles[0])
    if any(not each.is_whole for each in series):
        return empty("Nothing scored yet", "Frames are made and scored while nobody waits for another one.")
    if measure == "temporal" and not view.replays:
        return empty("Only in the protocol’s range", "It needs two camera frames in a row.")
    return empty("No such value here", _lacking(moment) or "No window ends near a camera frame.")


def _lacking(moment: Moment) -> str:
    """What the recording has not that the metrics need; empty where nothing lacks."""
    from etnet.evaluation.lpips import MIN_SIDE

    only = "only sharpness, contrast and events can be measured."
    if not moment.recording.ground_truth:
        return f"This recording has no camera frames: {only}"
    sensor = moment.recording.sensor
    if min(sensor.width, sensor.height) < MIN_SIDE:
        return f"LPIPS needs {MIN_SIDE} pixels a side, the sensor has {sensor}: {only}"
    return ""


def means_title(series: Sequence[Series]) -> str:
    """What the means are over."""
    num = len(common_keys(series))
    if not num:
        return "Means"
    scored = sum(not each.trouble for each in series)
    whose = "" if scored < 2 else " that both have" if scored == 2 else f" that all {scored} have"
    return f"Means over the {count(num)} frames{whose}"


def means_html(moment: Moment, series: Sequence[Series], view: CompareState) -> str:
    """One row a run: means over the frames that all have, grey until nothing more comes, and its worst frames."""
    keys = common_keys(series)
    measured: list[Measure] = [name for name in MEANT if any(np.isfinite(each.column(name)).any() for each in series)]
    names: list[Measure] = [name for name in measured if name in ARROWS] or measured
    if not names:
        return panel("means", _why_empty(moment, series, view.measure, view))
    means: dict[Measure, list[float]] = {name: [mean_over(each, name, keys) for each in series] for name in names}
    head = "".join(f"<th>{_SHORT.get(name, TITLES[name])} {ARROWS.get(name, '')}</th>" for name in names)
    rows = "".join(_row(moment, each, place, means, view.measure) for place, each in enumerate(series))
    waits = "" if all(each.is_whole for each in series) else " et-unfinished"
    table = f"<tr><th>run</th>{head}<th>worst frames</th></tr>{rows}"
    return panel(
        "means",
        f'<table class="et-means{waits}" data-testid="means-table">{table}</table>',
        _words(moment, series, view),
    )


def _row(moment: Moment, each: Series, place: int, means: dict[Measure, list[float]], measure: Measure) -> str:
    cells = "".join(
        f'<td data-testid="mean-{each.run.name}-{name}" data-value="{values[place]!r}"'
        f"{' class=et-best' if _is_best(name, values, place) else ''}>{decimals(values[place])}</td>"
        for name, values in means.items()
    )
    said = f'<span class="et-warning">{escape(each.trouble)}</span>' if each.trouble else _worst(moment, each, measure)
    tag = f'<b class="et-tag" style="--hue:{each.run.colour}">{each.run.name}</b>'
    return (
        f'<tr><th title="{escape(each.run.words)}">{tag}{escape(each.run.model_title)}</th>{cells}<td>{said}</td></tr>'
    )


def _is_best(measure: Measure, values: Sequence[float], place: int) -> bool:
    finite = [value for value in values if np.isfinite(value)]
    if measure not in ARROWS or len(finite) < 2 or len(set(finite)) == 1:
        return False
    return values[place] == (max(finite) if measure in BETTER_HIGH else min(finite))


def _worst(moment: Moment, each: Series, measure: Measure) -> str:
    by: Measure = "lpips" if measure in ("rate", "density") else measure
    if not np.isfinite(each.column(by)).any():
        by = "sharpness"
    start = moment.recording.span.start
    buttons = "".join(
        f'<button class="et-button et-quiet" data-k="goto:{(int(each.stamps[i]) - start) / 1e6:.6f}" {ON_PICK}'
        f' title="{_value(by, float(each.column(by)[i]))} {TITLES[by]}">'
        f"{seconds((int(each.stamps[i]) - start) / 1e6)}</button>"
        for i in worst_of(each, by, NUM_WORST)
    )
    return f'<span class="et-worst" data-testid="worst-{each.run.name}">{buttons}</span>'


def _words(moment: Moment, series: Sequence[Series], view: CompareState) -> str:
    said = [lacks] if (lacks := _lacking(moment)) else []
    if not len(common_keys(series)) and sum(len(each.stamps) > 0 for each in series) > 1:
        said.append("The runs have no frame in common, so there is nothing to average over.")
    if view.replays:
        said.append("As <code>etnet evaluate</code> prints it for these weights, to the last digit.")
        said += [escape(f"{remark}.") for remark in dict.fromkeys(text for each in series for text in each.remarks)]
    late = sum(int((np.abs(each.lags) > SAME_TIME).sum()) for each in series)
    if late:
        apart = max(float(np.abs(each.lags).max()) for each in series if len(each.lags)) / 1000
        said.append(
            f"{'1 frame lies' if late == 1 else f'{count(late)} frames lie'} more than 1 ms from the camera’s "
            f"(up to {short(apart)} ms): motion between counts as error there."
        )
    if any(each.is_sparse for each in series):
        said.append("A long recording: only windows whose frames exist are scored; play it to score more.")
    return f'<div class="et-note">{" ".join(said)}</div>' if said else ""


def _value(measure: Measure, value: float) -> str:
    return rate(value) if measure == "rate" else decimals(value)
