"""The side column of a comparison: the runs and how far each is, protocol, how they are shown, one pixel's values."""

from __future__ import annotations

from collections.abc import Sequence

from app.html.elements import ON_PICK, escape, segmented
from app.html.moment import Moment
from app.html.provenance import density_html
from app.html.units import count, seconds
from app.views.compare.html.run import RunShown, truth_frame
from app.views.compare.html.series import Series
from app.views.compare.state import MOST_RUNS, CompareState

RULES = {
    "paper": "ET-Net’s protocol: the raw frame, not clipped; SSIM 7×7 uniform, data range 2.",
    "evreal": "EVREAL’s protocol: post-processed where the network asks for it, clipped to 0 … 1; SSIM Gaussian 11×11.",
}


def runs_list_html(moment: Moment, series: Sequence[Series]) -> str:
    """One row a run: what it is, how far its scores are, what it was given."""
    rows = "".join(_row(moment, each) for each in series)
    add = f'<button class="et-button" data-k="compare:add" {ON_PICK}>Add a run</button>'
    note = '<span class="et-note">another network, windowing, filter …</span>'
    more = f'<div class="etv-row">{add}{note}</div>' if len(series) <= MOST_RUNS else ""
    return f'<div class="et etv-side" data-testid="runs"><h4>Runs</h4>{rows}{more}</div>'


def _row(moment: Moment, each: Series) -> str:
    run = each.run
    tag = f'<b class="et-tag" style="--hue:{run.colour}">{run.name}</b>'
    return (
        f'<div class="et-series" data-testid="series-{run.name}">{tag}<span>{escape(run.words)}</span>'
        f"<em>{_progress(each)}</em></div>{_given(moment, run)}"
    )


def _progress(each: Series) -> str:
    if each.run.trouble:
        return "cannot run"
    if each.trouble:
        return "not scored"
    if each.share >= 1:
        return f"{count(len(each.stamps))} scored"
    return f"{count(len(each.stamps))} of {count(each.num_wanted)}" if each.num_wanted else "waiting"


def _given(moment: Moment, run: RunShown) -> str:
    """Events per pixel against the trained band, and how warm the state is."""
    if run.trouble:
        return f'<div class="et-note et-warning">{escape(run.trouble)}</div>'
    if run.request is None:
        return '<div class="et-note">planning its windows</div>'
    dense = density_html(run.events_per_pixel(moment.recording.sensor.num_pixels) or 0.0, run.trained_band)
    since = "" if run.run.cold_from is None else f" · cold start at {_when(moment, run.run.cold_from)}"
    last = run.num_windows - 1
    return (
        f'<div class="et-note">{dense} ev/px · window {count(run.request.index)} of 0–{count(last)} · '
        f"{run.state_words}{since}</div>"
    )


def _when(moment: Moment, stamp: int) -> str:
    return seconds((stamp - moment.recording.span.start) / 1e6)


def protocol_html(view: CompareState, stretch: str) -> str:
    """By which rule frames are scored, and which of them. `stretch` says which part of the timeline counts."""
    rules = {"set:compare.rule:paper": "ET-Net", "set:compare.rule:evreal": "EVREAL"}
    frames = {"set:compare.replays:False": "timeline", "set:compare.replays:True": "protocol’s range"}
    return (
        f'<div class="et etv-side"><h4>Metric protocol</h4>'
        f'<div class="etv-row">{segmented("Metric protocol", rules, f"set:compare.rule:{view.rule}")}</div>'
        f'<div class="etv-row"><label>Windows</label>'
        f"{segmented('Windows that are scored', frames, f'set:compare.replays:{view.replays}')}</div>"
        f'<div class="etv-row"><label>Range</label><span>{escape(stretch)}</span></div>'
        f'<div class="et-note">{RULES[view.rule]} Tone mapping is for the eye alone.</div></div>'
    )


def sight_html(view: CompareState) -> str:
    """How the runs are shown. The lock of the zoom is the browser's own."""
    words = {"side by side": "side by side", "swipe": "swipe", "difference": "difference", "error": "error"}
    keys = {f"set:compare.sight:{name}": text for name, text in words.items()}
    meaning = {
        "side by side": "All at the same moment, each by its window that ends nearest.",
        "swipe": "Run A left of the line, each other picture right of it; drag on a picture.",
        "difference": "Raw frames, each run minus run A; the camera’s place shows A minus camera.",
        "error": "Raw frames, each run minus the camera.",
    }[view.sight]
    return (
        f'<div class="et etv-side"><h4>Show</h4>'
        f'<div class="etv-row">{segmented("Show", keys, f"set:compare.sight:{view.sight}")}</div>'
        f'<div class="et-note">{meaning}</div>'
        '<div class="etv-row"><label>Zoom locked</label>'
        '<button class="etv-toggle" data-etv-lock aria-pressed="true" aria-label="Zoom locked"></button>'
        '<span class="et-note">wheel zooms, drag pans, double-click shows all</span></div></div>'
    )


def pixel_html(moment: Moment, runs: Sequence[RunShown], query: tuple[int, int] | None) -> str:
    """The raw value of every run and of the camera at the chosen pixel."""
    if query is None or not runs:
        return '<div class="et etv-side"><h4>Pixel</h4><div class="et-note">Click a picture for raw values.</div></div>'
    x, y = query
    cells: list[tuple[str, float]] = []
    for run in runs:
        if run.ready is not None and y < run.ready.frame.shape[0] and x < run.ready.frame.shape[1]:
            cells.append((run.name, float(run.ready.frame[y, x])))
    truth = truth_frame(moment, runs[0].truth)
    if truth is not None:
        cells.append(("camera", float(truth[y, x])))
    rows = "".join(
        f'<div><dt>{name}</dt><dd data-testid="value-{name}" data-value="{value:.9g}">{value:.3f}</dd></div>'
        for name, value in cells
    )
    return (
        f'<div class="et etv-side"><h4>Pixel ({x}, {y})</h4><div class="et-note">raw values</div>'
        f'<dl class="et-figures">{rows}</dl></div>'
    )
