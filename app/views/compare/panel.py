"""Runs beside each other and their scores: what is compared, how it is shown, by which rule it is scored."""

from __future__ import annotations

from typing import Any

import viser

from app.engine.requests import Precision
from app.html.card import card
from app.html.choices import DEFAULTS, KINDS, PRECISIONS, STEPS, offered, policy_of, words_of
from app.state import intents as ask
from app.state.run import Run
from app.views.compare.html.run import runs_of
from app.views.compare.html.runs import runs_html
from app.views.compare.html.scores import TITLES, scores_html
from app.views.compare.jobs.runs import scored, slot_of
from app.views.compare.over_timeline import run_series
from app.views.compare.state import (
    ZOOMS,
    ChangeRun,
    CompareState,
    Inspector,
    Measure,
    Rule,
    Sight,
    StartCold,
)
from app.views.page import Choice, Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor, seconds_since_touched
from etnet.events.cleaning import UNCLEANED, Cleaning

INSPECTORS: dict[str, Inspector] = {
    "nothing": "none",
    "runs at this moment": "runs",
    "scores over time": "scores",
}
SIGHTS: dict[str, Sight] = {
    "side by side": "side by side",
    "swipe": "wipe",
    "difference": "difference",
    "error vs ground truth": "error",
}
AS_MAIN = "as run A"
RULES: dict[str, Rule] = {"paper (ET-Net)": "paper", "EVREAL": "evreal"}
CLEANINGS: dict[str, Cleaning | None] = {
    AS_MAIN: None,
    "no filter": UNCLEANED,
    "without hot pixels": Cleaning(hot_pixels=True),
    "supported within 20 ms": Cleaning(support_within=20_000),
    "supported within 5 ms": Cleaning(support_within=5_000),
    "both: no hot pixels, 5 ms": Cleaning(hot_pixels=True, support_within=5_000),
}
MEASURES: dict[str, Measure] = {title: name for name, title in TITLES.items()}  # pyright: ignore[reportAssignmentType]


class ComparePanel(Panel):
    """The runs fill the stage; their settings stand in the inspector column."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One card for all runs."""
        self._body = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """What is looked at, how it is shown and scored, then the chosen run's settings."""
        self._inspector = gui.add_dropdown("Compare", tuple(INSPECTORS))
        self._sight = gui.add_dropdown("Show", tuple(SIGHTS))
        self._measure = gui.add_dropdown("Metric", tuple(MEASURES))
        self._replays = gui.add_checkbox("Protocol’s own range", False)
        self._wipe = gui.add_slider("Swipe", 0.0, 1.0, 0.01, 0.5)
        self._build_run(gui, dispatch)
        self._zoom = gui.add_dropdown("Zoom", tuple(f"{zoom}×" for zoom in ZOOMS))
        self._rule = gui.add_dropdown("Metric protocol", tuple(RULES))
        self._offset = gui.add_number("Frame–event offset (ms)", 0.0, min=-1000.0, max=1000.0, step=0.5)
        on_visitor(self._inspector, lambda text: _set("inspector", INSPECTORS[text]), dispatch)
        on_visitor(self._sight, lambda text: _set("sight", SIGHTS[text]), dispatch)
        on_visitor(self._measure, lambda text: _set("measure", MEASURES[text]), dispatch)
        on_visitor(self._replays, lambda value: _set("replays", bool(value)), dispatch)
        on_visitor(self._wipe, lambda value: _set("wipe", float(value)), dispatch)
        on_visitor(self._zoom, lambda text: _set("zoom", int(text.rstrip("×"))), dispatch)
        on_visitor(self._rule, lambda text: _set("rule", RULES[text]), dispatch)
        on_visitor(self._offset, lambda value: _set("offset", round(float(value) * 1000)), dispatch)

    def _build_run(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        self._models: dict[str, str] = {}
        self._run = Html(gui)
        self._model: viser.GuiDropdownHandle[Any] = gui.add_dropdown("Network ", (AS_MAIN,))
        self._kind = gui.add_dropdown("Windowing ", (AS_MAIN, *KINDS))
        self._number = gui.add_number("Size ", 0.35, min=0.0001)
        self._precision = gui.add_dropdown("Precision ", (AS_MAIN, *PRECISIONS.values()))
        self._cleaning = gui.add_dropdown("Filter", tuple(CLEANINGS))
        self._cold = gui.add_checkbox("Cold start here", False)
        self._of_run = (self._model, self._kind, self._number, self._precision, self._cleaning, self._cold)
        arithmetic: dict[str, Precision] = {text: name for name, text in PRECISIONS.items()}
        on_visitor(self._model, lambda title: ChangeRun("model_id", self._models.get(title)), dispatch)
        on_visitor(self._kind, self._policy_of_kind, dispatch)
        on_visitor(self._number, self._policy_of_number, dispatch)
        on_visitor(self._precision, lambda text: ChangeRun("precision", arithmetic.get(text)), dispatch)
        on_visitor(self._cleaning, lambda text: ChangeRun("cleaning", CLEANINGS[text]), dispatch)
        on_visitor(self._cold, lambda value: StartCold(bool(value)), dispatch)

    def show(self, page: Page) -> None:
        """Draw what is compared."""
        self._body.show(card("compare", "Runs", _body(page), {"compare": "stage"}))

    def show_settings(self, page: Page) -> None:
        """Set the widgets to what is so."""
        view = page.state.of(CompareState)
        assign(self._inspector, _title(INSPECTORS, view.inspector))
        assign(self._sight, _title(SIGHTS, view.sight))
        assign(self._measure, _title(MEASURES, view.measure))
        assign(self._replays, view.replays)
        assign(self._wipe, view.wipe)
        assign(self._zoom, f"{view.zoom}×")
        assign(self._rule, _title(RULES, view.rule))
        assign(self._offset, view.offset / 1000)
        self._set_visible(view)
        self._show_run(page)

    def _set_visible(self, view: CompareState) -> None:
        runs, scores = view.inspector == "runs", view.inspector == "scores"
        _see(self._sight, runs)
        _see(self._wipe, runs and view.sight == "wipe")
        _see(self._zoom, runs)
        _see(self._measure, scores)
        _see(self._replays, scores)
        _see(self._rule, runs or scores)
        _see(self._offset, runs or (scores and not view.replays))

    def _show_run(self, page: Page) -> None:
        view = page.state.of(CompareState)
        is_shown = view.inspector in ("runs", "scores") and view.chosen < len(view.runs)
        self._run.set_visible(is_shown)
        for handle in self._of_run:
            _see(handle, is_shown)
        if not is_shown:
            return
        run = view.runs[view.chosen]
        self._run.show(f'<div class="et"><div class="et-lead">Run {"BCD"[view.chosen]}</div></div>')
        self._offer_models(page.models, run)
        kind, number = (AS_MAIN, 0.0) if run.policy is None else words_of(run.policy)
        assign(self._kind, kind)
        has_number = kind in STEPS
        _see(self._number, has_number)
        if has_number and seconds_since_touched(self._number) > 0.4:
            self._number.step = STEPS[kind]
            assign(self._number, number)
        assign(self._precision, AS_MAIN if run.precision is None else PRECISIONS[run.precision])
        known = [title for title, cleaning in CLEANINGS.items() if cleaning == run.cleaning]
        if known:
            assign(self._cleaning, known[0])
        assign(self._cold, run.cold_from is not None)

    def _offer_models(self, choices: tuple[Choice, ...], run: Run) -> None:
        titles = offered(choices)
        if titles != self._models:
            self._models = titles
            self._model.options = (AS_MAIN, *titles)
        assign(self._model, next((title for title, id_ in titles.items() if id_ == run.model_id), AS_MAIN))

    def _policy_of_kind(self, kind: str) -> Any:
        return ChangeRun("policy", None if kind == AS_MAIN else policy_of(kind, DEFAULTS.get(kind, 0.0)))

    def _policy_of_number(self, number: float) -> Any | None:
        return ChangeRun("policy", policy_of(self._kind.value, float(number))) if number > 0 else None


def _body(page: Page) -> str:
    view, moment = page.state.of(CompareState), page.moment
    if view.inspector == "none" or moment is None:
        return (
            '<div class="et"><div class="et-note">Set up to four runs beside each other: another network, '
            "other windows, other arithmetic, cleaned events, a cold start; with numbers.</div></div>"
        )
    if view.inspector == "runs":
        runs = [scored(run, page.results.get(slot_of("moment", run))) for run in runs_of(page)]
        return runs_html(moment, runs, view, page.state.query)
    return scores_html(moment, run_series(page), view)


def _set(field: str, value: object) -> ask.Set:
    return ask.Set("compare", field, value)


def _title(words: dict[str, Any], name: str) -> str:
    return next((title for title, known in words.items() if known == name), next(iter(words)))


def _see(handle: Any, is_visible: bool) -> None:
    if handle.visible != is_visible:
        handle.visible = is_visible
