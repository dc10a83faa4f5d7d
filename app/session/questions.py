"""Which jobs a view wants: one small function for each part of the page that has any. All of them are pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.export.jobs import SLOT as TAKEN
from app.views.export.jobs import export_jobs
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.recording.jobs.cut import SLOT as CUT
from app.views.recording.jobs.cut import trim_jobs
from app.views.recording.jobs.examination import examination_jobs
from app.views.recording.jobs.fitness import fitness_jobs

Asker = Callable[[ViewState, FrameRequest], Mapping[str, Job]]
"""(view, the request for its moment) → jobs by slot; none while its part of the page is closed."""

ASKERS: tuple[Asker, ...] = (inspect_jobs, fitness_jobs, examination_jobs, trim_jobs, export_jobs)


def questions(state: ViewState, request: FrameRequest) -> dict[str, Job]:
    """All jobs that a view wants, by slot."""
    wanted: dict[str, Job] = {}
    for asker in ASKERS:
        wanted.update(asker(state, request))
    return wanted


def given_up(state: ViewState) -> tuple[str, ...]:
    """Slots of files that nobody waits for any more: they end at once, and not when the page rests."""
    orders = {TAKEN: state.show.order, CUT: state.source.cut}
    return tuple(slot for slot, order in orders.items() if order is None)
