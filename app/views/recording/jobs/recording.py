"""All that the recording's view wants computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.catalogue.amount import amount_of
from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views.page import RunFrame
from app.views.recording.jobs.examination import examination_jobs
from app.views.recording.jobs.fitness import fitness_jobs
from app.views.view import NumSeen


def recording_jobs(state: ViewState, moment: Moment, runs: Sequence[RunFrame], num_seen: NumSeen) -> Mapping[str, Job]:
    """Statistics and sensor statistics of what is there by now, while they are open."""
    asked = state.recording_id, state.model_id, state.precision, moment.policy, 0
    request, amount = FrameRequest(*asked, cleaning=state.cleaning), amount_of(moment.recording)
    return {
        **fitness_jobs(state, request, amount),
        **examination_jobs(state, request, amount),
    }
