"""What stands above each run's picture: its name, and small selects of what it is made by."""

from __future__ import annotations

from collections.abc import Mapping

from app.engine.requests import Precision
from app.html.choices import PRECISIONS, STEPS, offered, words_of
from app.html.elements import escape, icon, icon_button, number_field, segmented, select
from app.views.compare.html.run import RunShown
from app.views.compare.html.series import TITLES
from app.views.compare.state import AS_MAIN, FILTERS, CompareState
from app.views.page import Page
from etnet.events.cleaning import Cleaning
from etnet.windows import Policy

_KINDS = {
    "camera frames": "between frames",
    "events per pixel": "events / pixel",
    "milliseconds": "ms",
    "number of events": "events",
}
_FILTERS = {
    "none": "no filter",
    "hot": "hot-pixel mask",
    "20ms": "activity filter 20 ms",
    "5ms": "activity filter 5 ms",
    "both": "mask + filter 5 ms",
}


def heads_html(page: Page, runs: tuple[RunShown, ...], view: CompareState) -> str:
    """The heads of all cards of the stage. They change only when a setting does, so that an open list stays open."""
    num = len(runs) + 1
    heads = "".join(_head(page, run, view, num) for run in runs)
    return heads + _camera_head(runs, view, num) + _measure(view)


def section(name: str, place: int, num: int, body: str, classes: str = "", test: str = "") -> str:
    """One cell of the stage: column `place` of `num`."""
    mark = f' data-testid="{test}"' if test else ""
    return (
        f'<section class="etv-card etv-staged {classes}" data-card="{name}" data-cards="{num}"'
        f' style="--place:{place}"{mark}>{body}</section>'
    )


def large_button(name: str) -> str:
    """One picture over the whole stage, or back; all in the browser."""
    words = "Show large, or back"
    return f'<button class="etv-icon" data-etv-large="{name}" title="{words}">{icon("expand")}</button>'


def _head(page: Page, run: RunShown, view: CompareState, num: int) -> str:
    name = f"compare.{run.name}"
    remove = icon_button(f"compare:remove:{run.number}", "close", "Remove this run") if run.number else ""
    tag = f'<b class="et-tag" style="--hue:{run.colour}">{run.name}</b>'
    header = f'<header>{tag}{_network(page, run)}<span class="etv-tools">{large_button(name)}{remove}</span></header>'
    made_by = _replayed(run) if view.replays else _windows(page, run) + _precision(page, run) + _cold(run)
    # A protocol takes the events as they are, whatever the page's own filter leaves out.
    made_by += "" if view.replays and not run.number else _filter(page, run)
    return section(
        f"{name}.head",
        run.number,
        num,
        f'{header}<div class="etv-selects">{made_by}</div>',
        "etv-over",
    )


def _network(page: Page, run: RunShown) -> str:
    titles = {model_id: title for title, model_id in offered(page.models).items()}
    if not run.number:
        return select("Network of run A", "compare:model:0", titles, page.state.model_id, classes="etv-title")
    main = titles.get(page.state.model_id, "as run A")
    options = {AS_MAIN: f"{main} (as A)", **titles}
    chosen = run.run.model_id or AS_MAIN
    return select(f"Network of run {run.name}", f"compare:model:{run.number}", options, chosen, classes="etv-title")


def _windows(page: Page, run: RunShown) -> str:
    """The kind of windows, and their size where they have one."""
    policy: Policy | None = run.run.policy if run.number else (page.moment.policy if page.moment else None)
    kind, size = (AS_MAIN, 0.0) if policy is None else words_of(policy)
    options: Mapping[str, str] = {AS_MAIN: "windows as A", **_KINDS} if run.number else _KINDS
    has_frames = page.moment is not None and bool(page.moment.recording.ground_truth)
    choice = select(
        f"Windowing of run {run.name}",
        f"compare:windows:{run.number}",
        options,
        kind,
        off="" if has_frames or kind == "camera frames" else "camera frames",
    )
    if kind not in STEPS:
        return choice
    return number_field(f"Size of run {run.name}", f"compare:windows:{run.number}:{kind}", size, STEPS[kind]) + choice


def _precision(page: Page, run: RunShown) -> str:
    options: dict[str, str] = {**PRECISIONS}
    chosen: Precision | str = page.state.precision
    if run.number:
        options = {AS_MAIN: f"{page.state.precision} (as A)", **options}
        chosen = run.run.precision or AS_MAIN
    return select(f"Precision of run {run.name}", f"compare:precision:{run.number}", options, chosen)


def _filter(page: Page, run: RunShown) -> str:
    cleaning = run.run.cleaning if run.number else page.state.cleaning
    options = {AS_MAIN: "filter as A", **_FILTERS} if run.number else dict(_FILTERS)
    chosen = AS_MAIN if cleaning is None else _word_of(cleaning)
    if cleaning is not None and chosen not in options:
        options[chosen] = f"filter {cleaning.text}"
    return select(f"Filter of run {run.name}", f"compare:filter:{run.number}", options, chosen)


def _word_of(cleaning: Cleaning) -> str:
    """The word of a filter that is offered; its own text for another one."""
    return next((word for word, offered_ in FILTERS.items() if offered_ == cleaning), cleaning.text)


def _cold(run: RunShown) -> str:
    if not run.number:
        return ""
    is_cold = run.run.cold_from is not None
    key = f"compare:cold:{run.number}:{'off' if is_cold else 'on'}"
    return (
        f'<button class="et-button et-quiet{" et-on" if is_cold else ""}" data-k="{key}" data-pick="1"'
        f' aria-pressed="{"true" if is_cold else "false"}" title="Zero the recurrent state at the current moment">'
        "cold start</button>"
    )


def _replayed(run: RunShown) -> str:
    return f'<span class="etv-note">{escape("protocol’s windows, cold start, fp32")}</span>'


def _camera_head(runs: tuple[RunShown, ...], view: CompareState, num: int) -> str:
    name = "compare.camera"
    options = {f"set:compare.camera:{run.name}": f"error of {run.name}" for run in runs}
    options = {"set:compare.camera:frame": "frame", **options}
    header = f'<header><h3>Camera</h3><span class="etv-tools">{large_button(name)}</span></header>'
    chosen = f"set:compare.camera:{view.camera}"
    body = f'<div class="etv-selects">{segmented("Show in the camera’s place", options, chosen)}</div>'
    return section(f"{name}.head", num - 1, num, header + body, "etv-over")


def _measure(view: CompareState) -> str:
    """The measure of the chart. It lies over that card: the chart is drawn again with every score."""
    options = {name: title for name, title in TITLES.items() if name != "temporal" or view.replays}
    choice = select("Metric", "set:compare.measure", options, view.measure)
    return f'<section class="etv-card etv-measure" data-card="compare.measure">{choice}</section>'
