"""What is known of every run over time, and its curves over the timeline."""

from __future__ import annotations

from app.views.compare.html.run import runs_of
from app.views.compare.html.scores import curves_over
from app.views.compare.html.series import Series, series_of
from app.views.compare.jobs.runs import result_over_time
from app.views.compare.state import CompareState
from app.views.page import Page


def run_series(page: Page) -> list[Series]:
    """What is known of every run over time."""
    view = page.state.of(CompareState)
    return [series_of(run, result_over_time(run, view, page.results)) for run in runs_of(page)]


def over_timeline(page: Page) -> str:
    """One curve a run over the timeline."""
    series = run_series(page)
    if page.moment is None or not series:
        return ""
    return curves_over(page.moment, series, page.state.of(CompareState).measure)
