"""All that the recording's view wants computed."""

from __future__ import annotations

from collections.abc import Mapping

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.recording.jobs.examination import examination_jobs
from app.views.recording.jobs.fitness import fitness_jobs


def recording_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """Statistics and sensor statistics, while they are open."""
    return {
        **fitness_jobs(state, request),
        **examination_jobs(state, request),
    }
