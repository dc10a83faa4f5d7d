"""What is known of every run over time, and its curves over the timeline."""

from __future__ import annotations

from app.views.compare.html.lane import lanes_of
from app.views.compare.html.scores import Series, curves_over, series_of
from app.views.compare.jobs.lanes import slot_of
from app.views.compare.state import CompareState
from app.views.page import Page


def lane_series(page: Page) -> list[Series]:
    """What is known of every lane over time; nothing unless scores are looked at."""
    view = page.state.of(CompareState)
    if view.inspector != "scores":
        return []
    lanes = lanes_of(page)
    subject = "protocol" if view.replays else "strip"
    found = [page.results.get(slot_of(subject, lane)) for lane in lanes]
    return [series_of(lane, result, view.replays) for lane, result in zip(lanes, found, strict=True)]


def over_timeline(page: Page) -> str:
    """One curve a run over the timeline, while scores are looked at."""
    series = lane_series(page)
    if page.moment is None or not series:
        return ""
    return curves_over(page.moment, series, page.state.of(CompareState).measure)
