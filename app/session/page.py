"""Everything that one visitor's page is drawn from, put together from what is known now."""

from __future__ import annotations

from dataclasses import dataclass

from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import VisitorUploads
from app.engine.engine import Engine
from app.html.moment import Moment
from app.html.pictures import Tones
from app.html.provenance import ModelFacts
from app.session.frames import NewestFrames
from app.session.jobs import VisitorJobs
from app.session.lanes import VisitorLanes
from app.session.loader import RecordingLoader
from app.state.link import to_link
from app.state.view_state import ViewState
from app.views.attention.html.maps import AttentionLook
from app.views.compare.html.lane import LaneShown
from app.views.compare.jobs.lanes import scored, slot_of
from app.views.export.command import Run
from app.views.timeline.html import Cached
from app.views.view import Choice, Page


@dataclass(frozen=True, slots=True)
class PageComposer:
    """Used by the visitor's thread alone."""

    catalogue: VisitorCatalogue
    engine: Engine
    answers: NewestFrames
    studying: VisitorJobs
    comparing: VisitorLanes
    held: RecordingLoader
    desk: VisitorUploads | None

    def page(self, state: ViewState, moment: Moment | None, cached: Cached | None, moves: bool, drags: bool) -> Page:
        """`moves`: what is drawn now is soon replaced; `drags`: by a finger, and not because the recording plays."""
        model = self.catalogue.model(state.model_id)
        answers = self.answers
        return Page(
            state,
            moment,
            answers.ready if moment is not None else None,
            answers.working,
            answers.failed,
            cached,
            Tones.of(state, model.is_linear_light),
            AttentionLook.of(state, model.is_linear_light),
            ModelFacts(model.title, model.trained_band, model.card),
            self.engine.status(answers.request).step_milliseconds if answers.request else None,
            moves,
            tuple(Choice(entry.id, entry.title, entry.subtitle) for entry in self.catalogue.entries()),
            tuple(Choice(entry.id, entry.title, entry.subtitle) for entry in self.catalogue.models()),
            self.held.trouble,
            self.catalogue.growing(),
            results=self.studying.results,
            lanes=self._lanes(state, moment),
            film=self.catalogue.film(state.recording_id),
            run=self._run(state),
            can_be_stated=self.catalogue.can_be_stated(state.recording_id),
            desk=None if self.desk is None else self.desk.shown,
            link=to_link(state, moment.window.t_stop) if moment is not None and not drags else "",
        )

    def _run(self, state: ViewState) -> Run | None:
        if self.catalogue.film(state.recording_id) is not None:
            return None  # a video has to be simulated first
        source, ready = self.catalogue.model(state.model_id).source, self.answers.ready
        model = source if isinstance(source, str) else source.name
        file = self.catalogue.file_name(state.recording_id)
        if ready is None or ready.request.playback[1:3] != (state.model_id, state.precision):
            return Run(file, model, state.precision)
        return Run(file, model, ready.contract.runtime.precision, ready.contract.device)

    def _lanes(self, state: ViewState, moment: Moment | None) -> tuple[LaneShown, ...]:
        results = self.studying.results
        lanes = self.comparing.lanes(state, moment, self.answers)
        return tuple(scored(lane, results.get(slot_of("moment", lane))) for lane in lanes)
