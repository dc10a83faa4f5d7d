"""Scores over time: one curve a run, means, the worst frames. A click on either goes there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64, Int64

from app.html.elements import ON_PICK, empty, escape, panel
from app.html.moment import Moment
from app.html.timeline_marks import place_of
from app.html.units import count, rate, seconds, short
from app.views.compare.html.run import SAME_TIME, RunShown
from app.views.compare.html.runs import RULES, decimals
from app.views.compare.state import CompareState

if TYPE_CHECKING:
    from app.engine.jobs import JobResult
    from app.views.compare.jobs.scores import StripScores
    from etnet.evaluation.scores import Scores

TITLES = {
    "lpips": "LPIPS ↓",
    "mse": "MSE ↓",
    "ssim": "SSIM ↑",
    "temporal": "temporal consistency ↓",
    "sharpness": "sharpness",
    "contrast": "contrast",
    "rate": "events per second",
    "density": "events per pixel",
}
MEANT = ("mse", "ssim", "lpips", "temporal", "sharpness", "contrast")
"""Measures of the table of means, in its order."""
BETTER_HIGH = ("ssim", "sharpness", "contrast")
NUM_WORST = 5
_WIDTH, _HEIGHT = 1000, 150


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """What is known of one run over time. `lags` as in `StripScores`; `share` 0 … 1."""

    run: RunShown
    stamps: Int64[np.ndarray, " n"]
    values: Mapping[str, Float64[np.ndarray, " n"]]
    lags: Int64[np.ndarray, " n"]
    share: float
    trouble: str = ""
    is_sparse: bool = False
    remarks: tuple[str, ...] = ()

    def mean(self, measure: str) -> float:
        """Over the frames that have it; NaN where none does."""
        column = self.values.get(measure, np.empty(0))
        return float(np.nanmean(column)) if np.isfinite(column).any() else float("nan")


def series_of(run: RunShown, result: JobResult | None, replays: bool) -> Series:
    """A run with what a job has found out; empty before it has."""
    none = np.empty(0, np.int64)
    if result is None or result.value is None:
        return Series(run, none, {}, none, 0.0, result.trouble if result else "")
    if replays:
        scores: Scores = result.value
        lags = np.zeros(len(scores.stamps), np.int64)
        values = {str(name): column for name, column in scores.rows["as it is"].items()}
        return Series(run, scores.stamps, values, lags, result.share, result.trouble, False, scores.remarks)
    strip: StripScores = result.value
    return Series(run, strip.stamps, strip.values, strip.lags, result.share, result.trouble, strip.is_sparse)


def scores_html(moment: Moment, series: Sequence[Series], view: CompareState) -> str:
    """The chart of one measure, all means, and the chosen run's worst frames."""
    if not series:
        return ""
    measure = view.measure
    has_it = any(np.isfinite(each.values.get(measure, np.empty(0))).any() for each in series)
    chart = _chart(moment, series, measure) if has_it else _why_empty(series, measure, view)
    worst = _worst(moment, series[min(view.chosen + 1, len(series) - 1)], measure) if has_it else ""
    title = f'<div class="et-lead">{TITLES[measure]}, one curve a run</div>'
    return panel("scores", title, chart, _progress(series), _means(series), worst, _words(series, view))


def _chart(moment: Moment, series: Sequence[Series], measure: str) -> str:
    span = moment.recording.span
    columns = [each.values.get(measure, np.empty(0)) for each in series]
    known = np.concatenate([column[np.isfinite(column)] for column in columns])
    low, high = float(known.min()), float(known.max())
    room = (high - low) * 0.08 or 0.01
    low, high = low - room, high + room
    lines = "".join(
        _line(each, column, span.start, span.stop, low, high) for each, column in zip(series, columns, strict=True)
    )
    duration = span.duration / 1e6
    picking = f' data-k="span:0,{duration:.6f}" {ON_PICK}'
    low_words, high_words, last = _value(measure, low), _value(measure, high), seconds(duration, 2)
    at = (moment.window.t_stop - span.start) / max(span.duration, 1)
    return (
        f'<div class="et-chart et-pick"{picking} data-testid="chart">'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none" aria-hidden="true">{lines}</svg>'
        f'<span class="et-chart-high">{high_words}</span><span class="et-chart-low">{low_words}</span>'
        f'<i class="et-head-line" style="left:{min(max(at, 0), 1):.3%}"></i></div>'
        f'<div class="et-caption"><span>0 s</span><span>click to go there</span><span>{last}</span></div>'
    )


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


def curves_over(moment: Moment, series: Sequence[Series], measure: str) -> str:
    """The same curves in the timeline's own measure (SVG, 1,000 wide): time across, 4 … 30 down."""
    columns = [each.values.get(measure, np.empty(0)) for each in series]
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


def _why_empty(series: Sequence[Series], measure: str, view: CompareState) -> str:
    if all(each.trouble for each in series):
        return empty("Cannot be scored", series[0].trouble)
    if any(each.share < 1 and not each.trouble for each in series):
        return empty("Nothing is scored yet", "Frames are made and scored while nobody waits for another one.")
    if measure == "temporal" and not view.replays:
        return empty("Only in the protocol’s own run", "It needs two frames of the camera in a row: replay the cut.")
    return empty("No such value here", "Without a camera frame only sharpness, contrast and events can be measured.")


def _progress(series: Sequence[Series]) -> str:
    parts = []
    for each in series:
        tag = f'<b class="et-tag" style="--hue:{each.run.colour}">{each.run.name}</b>'
        scored = f"{count(len(each.stamps))} scored" + ("" if each.share >= 1 else f", {each.share:.0%}")
        words = escape(each.trouble) if each.trouble else f"{escape(each.run.words)} · {scored}"
        done = (
            ""
            if each.share >= 1 or each.trouble
            else f'<div class="et-bar"><i style="width:{each.share:.0%}"></i></div>'
        )
        parts.append(
            f'<div class="et-series" data-testid="series-{each.run.name}">{tag}<span>{words}</span>{done}</div>'
        )
    return "".join(parts)


def _means(series: Sequence[Series]) -> str:
    names = [name for name in MEANT if any(np.isfinite(each.mean(name)) for each in series)]
    if not names:
        return ""
    head = "".join(f"<th>{TITLES[name].replace('temporal consistency', 'TC')}</th>" for name in names)
    rows = ""
    for each in series:
        cells = "".join(
            f'<td data-testid="mean-{each.run.name}-{name}" data-value="{mean!r}">{decimals(mean)}</td>'
            for name in names
            for mean in [each.mean(name)]
        )
        rows += f'<tr><th><b class="et-tag" style="--hue:{each.run.colour}">{each.run.name}</b></th>{cells}</tr>'
    return f'<table class="et-means"><tr><th>mean</th>{head}</tr>{rows}</table>'


def _worst(moment: Moment, each: Series, measure: str) -> str:
    column = each.values.get(measure, np.empty(0))
    if measure in ("rate", "density") or not np.isfinite(column).any():
        return ""
    badness = np.where(np.isfinite(column), -column if measure in BETTER_HIGH else column, -np.inf)
    chosen = [i for i in np.argsort(-badness, kind="stable")[:NUM_WORST].tolist() if np.isfinite(badness[i])]
    start = moment.recording.span.start
    buttons = "".join(
        f'<button class="et-back" data-k="goto:{(int(each.stamps[i]) - start) / 1e6:.6f}" {ON_PICK}>'
        f"{seconds((int(each.stamps[i]) - start) / 1e6)} · {_value(measure, float(column[i]))}</button>"
        for i in chosen
    )
    words = "lowest" if measure in ("sharpness", "contrast") else "worst"
    return (
        f'<div class="et-note">{words} frames of run {each.run.name}, {TITLES[measure].rstrip(" ↓↑")}</div>'
        f'<div class="et-chips" data-testid="worst">{buttons}</div>'
    )


def _words(series: Sequence[Series], view: CompareState) -> str:
    said = [f"{RULES[view.rule]}."]
    if view.replays:
        said.append("What <code>etnet evaluate</code> prints for these weights in fp32, to the last digit.")
        said += [escape(f"{remark}.") for remark in dict.fromkeys(text for each in series for text in each.remarks)]
    late = sum(int((np.abs(each.lags) > SAME_TIME).sum()) for each in series)
    if late:
        apart = max(float(np.abs(each.lags).max()) for each in series if len(each.lags)) / 1000
        said.append(
            f"{count(late)} frames lie more than 1 ms from their camera frame (up to {short(apart)} ms): "
            "motion between counts as error there."
        )
    if any(each.is_sparse for each in series):
        said.append("A long recording: only windows whose images exist are scored; play it to score more.")
    return f'<div class="et-note">{" ".join(said)}</div>'


def _value(measure: str, value: float) -> str:
    return rate(value) if measure == "rate" else decimals(value)
