"""Runs beside each other on the stage, their scores on the shelf, and what is compared in the side column."""

from __future__ import annotations

import viser

from app.html.elements import card, empty
from app.html.moment import Moment
from app.html.units import seconds
from app.state import intents as ask
from app.views.compare.html.heads import heads_html
from app.views.compare.html.run import RunShown, runs_of
from app.views.compare.html.scores import chart_html, chart_note, means_html, means_title
from app.views.compare.html.series import TITLES, Series, within
from app.views.compare.html.side import pixel_html, protocol_html, runs_list_html, sight_html
from app.views.compare.html.stage import pictures_html
from app.views.compare.jobs.runs import scored, slot_of
from app.views.compare.over_timeline import run_series
from app.views.compare.state import CompareState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from etnet.windows import ByStamps

WHOLE = "whole recording"
_NAMES = {"paper": "ET-Net protocol", "evreal": "EVREAL protocol"}


class ComparePanel(Panel):
    """Elements that change at different times are different elements: an open list outlives a new frame."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The heads, the pictures below them, the chart, the means."""
        self._heads = Html(gui)
        self._pictures = Html(gui)
        self._chart = Html(gui)
        self._means = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The side column; the offset between the two clocks is a number that is typed."""
        self._runs = Html(gui)
        self._protocol = Html(gui)
        self._offset = gui.add_number("Frame–event offset (ms)", 0.0, min=-1000.0, max=1000.0, step=0.5)
        self._show = Html(gui)
        self._pixel = Html(gui)
        on_visitor(self._offset, lambda value: ask.Set("compare", "offset", round(float(value) * 1000)), dispatch)

    def show(self, page: Page) -> None:
        """Draw the runs at this moment and what is known of them over time."""
        view, moment = page.state.of(CompareState), page.moment
        if moment is None:
            self._heads.show("")
            body = empty("Nothing to compare yet", page.trouble or "Open a recording first.")
            self._pictures.show(card("compare.A", "Runs", body, {"compare.A": "stage"}))
            return
        runs = _scored_runs(page)
        series = run_series(page)
        self._heads.show(heads_html(page, runs, view))
        self._pictures.show(pictures_html(moment, runs, view, page.state.query))
        title, note = f"{TITLES[view.measure]} over time", chart_note(view.measure)
        self._chart.show(_shelved("compare.chart", title, chart_html(moment, series, view), note))
        counted = _counted(page, series)
        self._means.show(
            _shelved("compare.means", means_title(counted), means_html(moment, counted, view), _NAMES[view.rule])
        )

    def show_settings(self, page: Page) -> None:
        """Say what is compared and how."""
        view, moment = page.state.of(CompareState), page.moment
        if moment is None:
            self._runs.show("")
            return
        series = run_series(page)
        self._runs.show(runs_list_html(moment, series))
        self._protocol.show(protocol_html(view, _stretch(moment, series) if view.replays else _marked(page, moment)))
        assign(self._offset, view.offset / 1000)
        self._show.show(sight_html(view))
        self._pixel.show(pixel_html(moment, runs_of(page), page.state.query))


def _stretch(moment: Moment, series: list[Series]) -> str:
    """From the first frame that a protocol scores to the last."""
    known = [each.run for each in series if each.run.request is not None]
    policy = known[0].request.policy if known and known[0].request is not None else None
    if not isinstance(policy, ByStamps):
        return "the protocol’s"
    start = moment.recording.span.start
    return f"{seconds((policy.stamps[0] - start) / 1e6)} – {seconds((policy.stamps[-1] - start) / 1e6)}"


def _marked(page: Page, moment: Moment) -> str:
    """The stretch of the timeline that means are over."""
    start, low, high = moment.recording.span.start, page.state.mark_a, page.state.mark_b
    if low is None and high is None:
        return WHOLE
    ends = [f"{(stamp - start) / 1e6:.3f}" for stamp in (low or start, high or moment.recording.span.stop)]
    return f"A–B of the timeline: {ends[0]} – {ends[1]} s"


def _counted(page: Page, series: list[Series]) -> list[Series]:
    """What means are over: the frames between the timeline's marks, or all that a protocol scores."""
    if page.state.of(CompareState).replays:
        return series
    return [within(each, page.state.mark_a, page.state.mark_b) for each in series]


def _scored_runs(page: Page) -> tuple[RunShown, ...]:
    return tuple(scored(run, page.results.get(slot_of("moment", run))) for run in runs_of(page))


def _shelved(name: str, title: str, body: str, note: str) -> str:
    return card(name, title, body, {name: "stage"}, note=note, classes="etv-low")
