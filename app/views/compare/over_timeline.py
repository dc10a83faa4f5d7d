"""What is known of every run over time, and its curves over the timeline."""

from __future__ import annotations

from app.views.compare.html.run import runs_of
from app.views.compare.html.scores import Series, curves_over, series_of
from app.views.compare.jobs.runs import slot_of
from app.views.compare.state import CompareState
from app.views.page import Page


def run_series(page: Page) -> list[Series]:
    """What is known of every run over time; nothing unless scores are looked at."""
    view = page.state.of(CompareState)
    if view.inspector != "scores":
        return []
    runs = runs_of(page)
    subject = "protocol" if view.replays else "strip"
    found = [page.results.get(slot_of(subject, run)) for run in runs]
    return [series_of(run, result, view.replays) for run, result in zip(runs, found, strict=True)]


def over_timeline(page: Page) -> str:
    """One curve a run over the timeline, while scores are looked at."""
    series = run_series(page)
    if page.moment is None or not series:
        return ""
    return curves_over(page.moment, series, page.state.of(CompareState).measure)
