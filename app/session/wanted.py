"""What a page wants of the engine: the request for its frame, the runs beside it, its jobs."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from app.catalogue.visitor import VisitorCatalogue
from app.engine.engine import Engine
from app.engine.jobs import Job
from app.engine.requests import FrameRequest, Reply
from app.html.moment import Moment
from app.session.frames import NewestFrames
from app.session.jobs import JobNews, VisitorJobs
from app.session.runs import RunPlanned, RunReply, VisitorRuns
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


class VisitorRequests:
    """Keeps what is asked of the engine equal to what a page wants. Used by the visitor's thread, but for `hear`."""

    def __init__(
        self,
        engine: Engine,
        catalogue: VisitorCatalogue,
        visitor: str,
        views: Sequence[View],
        post: Callable[[Any], None],
    ) -> None:
        self._engine, self._visitor, self._views, self._post = engine, visitor, views, post
        self.frames = NewestFrames()
        self.jobs = VisitorJobs(engine, visitor, post)
        self._runs = VisitorRuns(engine, catalogue, visitor, post)
        self._has_compared = False
        self._own_thread: int | None = None

    def begin(self) -> None:
        """The thread that calls this is the visitor's."""
        self._own_thread = threading.get_ident()

    def close(self) -> None:
        """The visitor has gone."""
        self._runs.close()
        self._engine.drop(self._visitor)

    def take(self, news: Reply | JobNews | RunPlanned | RunReply) -> bool:
        """Fold one letter of the engine; whether it is news."""
        if isinstance(news, JobNews):
            return self.jobs.take(news)
        return self._runs.take(news) if isinstance(news, RunPlanned | RunReply) else self.frames.take(news)

    def ask(self, state: ViewState, moment: Moment, is_moving: bool) -> tuple[RunFrame, ...]:
        """Ask for the frame of the moment, those of the runs, and what open views want computed; the runs."""
        request, compared = request_of(state, moment.policy, self._views), compared_runs(state, self._views)
        is_about_runs = compared is not None or self._has_compared  # once more when they are over: they are dropped
        self._has_compared = compared is not None
        runs = self._runs.runs(state, compared, moment, self.frames) if is_about_runs else ()
        if self.frames.ask(request):
            self._engine.request(self._visitor, request, self.hear)
        if is_about_runs:
            self._runs.ask(runs)
        jobs = partial(jobs_of, state, request, moment, runs, self._views, self._num_seen)
        self.jobs.follow(state, is_moving, jobs)
        return runs

    def hear(self, reply: Reply) -> None:
        """A frame that is at hand comes back while it is asked for: it is drawn with this push, not with the next."""
        if threading.get_ident() == self._own_thread:
            self.frames.take(reply)
        else:
            self._post(reply)

    def _num_seen(self, request: FrameRequest) -> int:
        cached = self._engine.cached(request)
        return 0 if cached is None else sum(len(part) for part in cached.frames)
