"""One visitor's page: what it is drawn from, put together from what is known now, and what it wants of the engine."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from app.catalogue.live import LiveShown
from app.catalogue.visitor import VisitorCatalogue
from app.engine.engine import Engine
from app.engine.jobs import Job, JobResult
from app.engine.requests import FrameRequest, Reply
from app.html.moment import Moment
from app.html.timeline_marks import Cached, Hovered
from app.session.booth import Booth
from app.session.facts import KnownFacts
from app.session.frames import NewestFrames
from app.session.jobs import JobNews, VisitorJobs
from app.session.loader import RecordingLoader
from app.session.runs import RunPlanned, RunReply, VisitorRuns
from app.session.standing import NOTHING_REFUSED, Refused
from app.state.link import to_link
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.page import Page, RunFrame
from app.views.view import NumSeen, View, areas, changing_views, open_views, speaking_views, touched_views
from etnet.windows import Policy

SCENE_INTERVAL = 1 / 12
"""Seconds between two pushes to the 3-D scene while it moves: a browser that is sent more textures shows fewer."""

FOLLOW_INTERVAL = 1 / 20
"""Seconds between two looks at a source that is followed; an image of the network is drawn when it comes. What the page
is drawn with, the network does not have: a step waits for the page's thread and the page for the step."""


IMAGES_A_SCENE = 2.0
"""Of the mirror, for one push to the scene: a browser that draws it in software on the same machine slows the network,
and then gets it less often."""


class ScenePace:
    """Which pages of a drag reach the 3-D scene; at rest all do."""

    def __init__(self) -> None:
        self._drawn_at = 0.0

    def is_due(self, is_moving: bool, step: float | None = None) -> bool:
        """Whether the page that is made now is one of them. `step`: of the network, ms, where it must keep up with what
        the scene shows."""
        now = time.monotonic()
        interval = SCENE_INTERVAL if step is None else max(SCENE_INTERVAL, IMAGES_A_SCENE * step / 1000)
        if is_moving and now - self._drawn_at < interval:
            return False
        self._drawn_at = now
        return True


@dataclass(frozen=True, slots=True)
class PageComposer:
    """Used by the visitor's thread alone."""

    views: Sequence[View]
    known: KnownFacts
    engine: Engine
    frames: NewestFrames
    loader: RecordingLoader
    booth: Booth
    scene_pace: ScenePace = field(default_factory=ScenePace)

    def page(
        self,
        state: ViewState,
        moment: Moment | None,
        runs: tuple[RunFrame, ...],
        results: Mapping[str, JobResult],
        cached: Cached | None,
        is_moving: bool,
        hovers_at: float | None = None,
        refused: Refused = NOTHING_REFUSED,
    ) -> Page:
        """`is_moving`: what is drawn now is soon replaced, by a finger or because it plays."""
        frames, booth, facts, limits = self.frames, self.booth, self.known.of(state), self.loader.limits(state)
        step = self.engine.status(frames.request).step_milliseconds if frames.request else None
        page = Page(
            state,
            moment,
            frames.ready if moment is not None else None,
            frames.working,
            frames.failed,
            cached,
            facts.model,
            step,
            self._hovered(state, moment, hovers_at),
            is_moving,
            facts.recordings,
            facts.models,
            self.loader.said_gone(state) or self.loader.trouble,
            facts.growing,
            results=results,
            runs=runs,
            video=None if facts.video is None else self.known.film(state),
            file_name=facts.file_name,
            stated_id=self._stated_id(state, facts.can_be_stated, refused.recording_id),
            can_be_binned=facts.can_be_binned,
            uploads=facts.uploads,
            link=to_link(state, moment.window.t_stop) if moment is not None and not is_moving else "",
            draws_scene=self.scene_pace.is_due(is_moving, step if self.booth.is_live(state) else None),
            areas=areas(state, self.views),
            placed=self.loader.placed(state),
            live=self._live(frames, limits.is_live, state.is_public),
            is_live=limits.is_live,
            follows=limits.is_live and state.follows_newest,
            gone=self.loader.said_gone(state),
            refused=refused.why,
            mirror=booth.shown(moment, frames.index) if booth.is_active else booth.idle,
            presenting=booth.presenting if booth.is_active else "",
            gives_home=booth.homes is not None,
            public_url=booth.public_url,
        )
        opened = speaking_views(state, self.views, results)
        marking = dict.fromkeys((*opened, *changing_views(state, self.views)))
        if not marking:
            return page
        clouds = (cloud for view in opened if (cloud := view.cloud(page)) is not None)
        return replace(
            page, over_timeline="".join(view.over_timeline(page) for view in marking), cloud=next(clouds, None)
        )

    def _stated_id(self, state: ViewState, can_be_stated: bool, refused_id: str) -> str:
        """Of the refused recording first: saying what its file does not is the way to open it."""
        if refused_id and self.known.can_be_stated(refused_id):
            return refused_id
        return state.recording_id if can_be_stated else ""

    def _live(self, frames: NewestFrames, is_live: bool, is_public: bool) -> LiveShown | None:
        if not self.known.has_live or not (is_live or not is_public):
            return None
        return self.known.live(frames.ready.request.index if is_live and frames.ready is not None else None)

    def _hovered(self, state: ViewState, moment: Moment | None, hovers_at: float | None) -> Hovered | None:
        """The window under the pointer, and a small frame of it if one is held."""
        request = self.frames.request
        if hovers_at is None or moment is None or request is None:
            return None
        limits = self.loader.limits(state)
        there = replace(request, index=limits.index_at(limits.start + round(hovers_at * 1e6)))
        return Hovered(hovers_at, there.index, self.engine.thumbnail(there), there.key)


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
        self._runs = VisitorRuns(engine, catalogue, engine.cleaned, visitor, post)
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

    def ask(self, state: ViewState, moment: Moment, is_moving: bool, follows: bool) -> tuple[RunFrame, ...]:
        """Ask for the frame of the moment, those of the runs, and what open views want computed; the runs.

        `follows`: the page goes with a live source, and never comes to rest.
        """
        request, compared = request_of(state, moment.policy, self._views), compared_runs(state, self._views)
        is_about_runs = compared is not None or self._has_compared  # once more when they are over: they are dropped
        self._has_compared = compared is not None
        runs = self._runs.runs(state, compared, moment, self.frames) if is_about_runs else ()
        if self.frames.ask(request):
            self._engine.request(self._visitor, request, self.hear)
        if is_about_runs:
            self._runs.ask(runs)
        jobs = partial(jobs_of, state, request, moment, runs, self._views, self._num_seen)
        if follows:
            self.jobs.follow(jobs(), state.index)
        else:
            self.jobs.ask(state, is_moving, jobs)
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
