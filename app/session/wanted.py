"""What a page wants of the engine, as values: the request for its frame, the runs beside it, its jobs."""

from __future__ import annotations

from collections.abc import Sequence

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.page import RunFrame
from app.views.view import NumSeen, View, open_views, touched_views
from etnet.windows import Policy


def request_of(state: ViewState, policy: Policy, views: Sequence[View]) -> FrameRequest:
    """The frame of a page whose windows are cut by `policy`, with what its views change in it."""
    asked = state.recording_id, state.model_id, state.precision, policy, state.index
    request = FrameRequest(*asked, wants_attention=state.query is not None, cleaning=state.cleaning)
    for view in touched_views(state, views):
        request = view.change_request(view.of(state), request)
    return request


def compared_runs(state: ViewState, views: Sequence[View]) -> tuple[Run, ...] | None:
    """The runs that an open view compares, the main one first."""
    found = (view.runs(state) for view in open_views(state, views))
    return next((runs for runs in found if runs is not None), None)


def jobs_of(
    state: ViewState,
    request: FrameRequest,
    moment: Moment,
    runs: tuple[RunFrame, ...],
    views: Sequence[View],
    num_seen: NumSeen,
) -> dict[str, Job]:
    """What open views want computed, and the files that were ordered, by slot."""
    jobs: dict[str, Job] = {}
    for view in open_views(state, views):
        jobs.update(view.jobs(state, request))
        jobs.update(view.run_jobs(state, moment, runs, num_seen))
    for view in touched_views(state, views):
        jobs.update(view.background_jobs(state, request))
    return jobs
