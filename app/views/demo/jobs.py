"""The page that a visitor takes home, made while nobody waits."""

from __future__ import annotations

from collections.abc import Mapping

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import ViewState
from app.views.demo.state import HOME_SLOT, DemoState
from app.views.export.jobs import ExportJob


def home_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    """The page that was ordered, if any: the one-file page of `etnet export page`."""
    order = state.of(DemoState).order
    return {} if order is None else {HOME_SLOT: ExportJob(order)}
