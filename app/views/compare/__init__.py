"""Runs beside each other at one moment, and their scores over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.state import intents as ask
from app.views.compare.jobs.runs import run_jobs
from app.views.compare.over_timeline import over_timeline
from app.views.compare.state import CompareState, compared_runs, hear, reduce_compare
from app.views.view import View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.compare.panel import ComparePanel

    return ComparePanel()


VIEW = View(
    "compare",
    "Runs",
    "COLUMNS_3",
    CompareState(),
    _panel,
    workspaces=frozenset({"compare"}),
    settings_in=frozenset({"compare"}),
    reduce=reduce_compare,
    intents=(ask.OpenRecording, ask.ReopenRecording, ask.Settle, ask.FormChanged),
    hear=hear,
    runs=compared_runs,
    run_jobs=run_jobs,
    over_timeline=over_timeline,
)
