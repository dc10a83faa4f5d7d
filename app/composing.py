"""Everything that one visitor's page is drawn from, put together from what is known now."""

from __future__ import annotations

from dataclasses import dataclass

from app.answers import Answers
from app.comparing import Comparing
from app.desk import Desk
from app.engine import Engine
from app.held import Held
from app.link import to_link
from app.looking.lanes import scored, slot_of
from app.own_catalogue import OwnCatalogue
from app.panels.base import Choice, Page
from app.present import AttentionLook, ModelFacts, Moment, Tones
from app.present.command import Run
from app.present.lane import LaneShown
from app.present.timeline import Cached
from app.studying import Studying
from app.view_state import ViewState


@dataclass(frozen=True, slots=True)
class Composer:
    """Used by the visitor's thread alone."""

    catalogue: OwnCatalogue
    engine: Engine
    answers: Answers
    studying: Studying
    comparing: Comparing
    held: Held
    desk: Desk | None

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
            self.engine.status(answers.wish).step_milliseconds if answers.wish else None,
            moves,
            tuple(Choice(entry.id, entry.title, entry.subtitle) for entry in self.catalogue.entries()),
            tuple(Choice(entry.id, entry.title, entry.subtitle) for entry in self.catalogue.models()),
            self.held.trouble,
            self.catalogue.growing(),
            findings=self.studying.findings,
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
        if ready is None or ready.wish.playback[1:3] != (state.model_id, state.precision):
            return Run(file, model, state.precision)
        return Run(file, model, ready.contract.runtime.precision, ready.contract.device)

    def _lanes(self, state: ViewState, moment: Moment | None) -> tuple[LaneShown, ...]:
        findings = self.studying.findings
        lanes = self.comparing.lanes(state, moment, self.answers)
        return tuple(scored(lane, findings.get(slot_of("moment", lane))) for lane in lanes)
