"""Noise taken out of the events before anything is made of them; and why a frame is bad, with what helps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.filter.jobs import filter_jobs
from app.views.filter.state import FilterState, hear
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.filter.panel import FilterPanel

    return FilterPanel()


VIEW = View(
    "filter",
    "Filter",
    "FILTER",
    FilterState(),
    _panel,
    settings_in=frozenset({"inspect", "attention", "compare", "recording"}),
    hear=hear,
    run_jobs=filter_jobs,
)
