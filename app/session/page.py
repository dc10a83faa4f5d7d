"""Everything that one visitor's page is drawn from, put together from what is known now."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import VisitorUploads
from app.engine.engine import Engine
from app.engine.jobs import JobResult
from app.engine.thumbnails import thumbnail_key
from app.html.moment import Moment
from app.html.timeline_marks import Cached, Hovered
from app.session.booth import Booth
from app.session.facts import facts_of
from app.session.frames import NewestFrames
from app.session.loader import RecordingLoader
from app.state.link import to_link
from app.state.view_state import ViewState
from app.views.page import Choice, Page, RunFrame
from app.views.view import View, areas, changing_views, open_views


@dataclass(frozen=True, slots=True)
class PageComposer:
    """Used by the visitor's thread alone."""

    views: Sequence[View]
    catalogue: VisitorCatalogue
    engine: Engine
    frames: NewestFrames
    loader: RecordingLoader
    uploads: VisitorUploads | None
    booth: Booth

    def page(
        self,
        state: ViewState,
        moment: Moment | None,
        runs: tuple[RunFrame, ...],
        results: Mapping[str, JobResult],
        cached: Cached | None,
        is_moving: bool,
        is_dragged: bool,
        hovers_at: float | None = None,
        refused: str = "",
    ) -> Page:
        """`is_moving`: what is drawn now is soon replaced; `is_dragged`: by a finger, not because it plays."""
        frames, catalogue, limits = self.frames, self.catalogue, self.loader.limits(state)
        shown_index = frames.ready.request.index if limits.is_live and frames.ready is not None else None
        page = Page(
            state,
            moment,
            frames.ready if moment is not None else None,
            frames.working,
            frames.failed,
            cached,
            facts_of(catalogue.model(state.model_id)),
            self.engine.status(frames.request).step_milliseconds if frames.request else None,
            self._hovered(state, moment, hovers_at),
            is_moving,
            tuple(
                Choice(entry.id, entry.title, entry.subtitle, catalogue.facts(entry)) for entry in catalogue.entries()
            ),
            tuple(Choice(entry.id, entry.title, entry.subtitle) for entry in catalogue.models()),
            self.loader.said_gone(state) or self.loader.trouble,
            catalogue.growing(),
            results=results,
            runs=runs,
            video=catalogue.film(state.recording_id),
            file_name=catalogue.file_name(state.recording_id),
            can_be_stated=catalogue.can_be_stated(state.recording_id),
            can_be_binned=catalogue.can_be_binned(state.recording_id),
            uploads=None if self.uploads is None else self.uploads.shown,
            link=to_link(state, moment.window.t_stop) if moment is not None and not is_dragged else "",
            areas=areas(state, self.views),
            placed=self.loader.placed(state),
            live=None if state.is_public and not limits.is_live else catalogue.live(shown_index),
            is_live=limits.is_live,
            follows=limits.is_live and state.follows_newest,
            gone=self.loader.said_gone(state),
            refused=refused,
            mirror=self.booth.shown(moment, frames.index),
            gives_home=self.booth.homes is not None,
            public_url=self.booth.public_url,
        )
        opened = open_views(state, self.views)
        marking = dict.fromkeys((*opened, *changing_views(state, self.views)))
        clouds = (cloud for view in opened if (cloud := view.cloud(page)) is not None)
        return replace(
            page, over_timeline="".join(view.over_timeline(page) for view in marking), cloud=next(clouds, None)
        )

    def _hovered(self, state: ViewState, moment: Moment | None, hovers_at: float | None) -> Hovered | None:
        """The window under the pointer, and a small frame of it if one is held."""
        request = self.frames.request
        if hovers_at is None or moment is None or request is None:
            return None
        limits = self.loader.limits(state)
        there = replace(request, index=limits.index_at(limits.start + round(hovers_at * 1e6)))
        return Hovered(hovers_at, there.index, self.engine.thumbnail(there), thumbnail_key(there))
