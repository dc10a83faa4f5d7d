"""Everything that one visitor's page is drawn from, put together from what is known now."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.engine.engine import Engine
from app.engine.jobs import JobResult
from app.engine.thumbnails import thumbnail_key
from app.html.moment import Moment
from app.html.timeline_marks import Cached, Hovered
from app.session.booth import Booth
from app.session.facts import KnownFacts
from app.session.frames import NewestFrames
from app.session.loader import RecordingLoader
from app.session.standing import NOTHING_REFUSED, Refused
from app.state.link import to_link
from app.state.view_state import ViewState
from app.views.page import Page, RunFrame
from app.views.view import View, areas, changing_views, open_views

SCENE_INTERVAL = 1 / 12
"""Seconds between two pushes to the 3-D scene while it moves: a browser that is sent more textures shows fewer."""

FOLLOW_INTERVAL = 1 / 20
"""Seconds between two looks at a source that is followed; an image of the network is drawn when it comes. What the page
is drawn with, the network does not have: a step waits for the page's thread and the page for the step."""


class ScenePace:
    """Which pages of a drag reach the 3-D scene; at rest all do."""

    def __init__(self) -> None:
        self._drawn_at = 0.0

    def is_due(self, is_moving: bool) -> bool:
        """Whether the page that is made now is one of them."""
        now = time.monotonic()
        if is_moving and now - self._drawn_at < SCENE_INTERVAL:
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
        frames, facts, limits = self.frames, self.known.of(state), self.loader.limits(state)
        shown_index = frames.ready.request.index if limits.is_live and frames.ready is not None else None
        page = Page(
            state,
            moment,
            frames.ready if moment is not None else None,
            frames.working,
            frames.failed,
            cached,
            facts.model,
            self.engine.status(frames.request).step_milliseconds if frames.request else None,
            self._hovered(state, moment, hovers_at),
            is_moving,
            facts.recordings,
            facts.models,
            self.loader.said_gone(state) or self.loader.trouble,
            facts.growing,
            results=results,
            runs=runs,
            video=facts.video,
            file_name=facts.file_name,
            stated_id=self._stated_id(state, facts.can_be_stated, refused.recording_id),
            can_be_binned=facts.can_be_binned,
            uploads=facts.uploads,
            link=to_link(state, moment.window.t_stop) if moment is not None and not is_moving else "",
            draws_scene=self.scene_pace.is_due(is_moving),
            areas=areas(state, self.views),
            placed=self.loader.placed(state),
            live=None if state.is_public and not limits.is_live else self.known.live(shown_index),
            is_live=limits.is_live,
            follows=limits.is_live and state.follows_newest,
            gone=self.loader.said_gone(state),
            refused=refused.why,
            mirror=self.booth.shown(moment, frames.index),
            presenting=self.booth.presenting,
            gives_home=self.booth.homes is not None,
            public_url=self.booth.public_url,
        )
        opened = open_views(state, self.views)
        marking = dict.fromkeys((*opened, *changing_views(state, self.views)))
        clouds = (cloud for view in opened if (cloud := view.cloud(page)) is not None)
        return replace(
            page, over_timeline="".join(view.over_timeline(page) for view in marking), cloud=next(clouds, None)
        )

    def _stated_id(self, state: ViewState, can_be_stated: bool, refused_id: str) -> str:
        """Of the refused recording first: saying what its file does not is the way to open it."""
        if refused_id and self.known.can_be_stated(refused_id):
            return refused_id
        return state.recording_id if can_be_stated else ""

    def _hovered(self, state: ViewState, moment: Moment | None, hovers_at: float | None) -> Hovered | None:
        """The window under the pointer, and a small frame of it if one is held."""
        request = self.frames.request
        if hovers_at is None or moment is None or request is None:
            return None
        limits = self.loader.limits(state)
        there = replace(request, index=limits.index_at(limits.start + round(hovers_at * 1e6)))
        return Hovered(hovers_at, there.index, self.engine.thumbnail(there), thumbnail_key(there))
