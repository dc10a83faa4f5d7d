"""What the catalogue says to one visitor: asked when something may have changed, not for every picture of a drag."""

from __future__ import annotations

import time
from dataclasses import dataclass

from app.catalogue.live import LiveShown
from app.catalogue.models import ModelEntry
from app.catalogue.videos import VideoShown
from app.catalogue.visitor import VisitorCatalogue
from app.catalogue.visitor_uploads import UploadsShown, VisitorUploads
from app.html.provenance import ModelFacts
from app.state.view_state import ViewState
from app.views.page import Choice

LOOK_EVERY = 0.5
"""Seconds between two looks while nothing is done that changes the catalogue."""


@dataclass(frozen=True, slots=True)
class Facts:
    """Everything of a page that comes from the catalogue."""

    recording_id: str
    model_id: str
    model: ModelFacts
    recordings: tuple[Choice, ...]
    models: tuple[Choice, ...]
    growing: tuple[str, ...]
    video: VideoShown | None
    file_name: str
    can_be_stated: bool
    can_be_binned: bool
    uploads: UploadsShown | None


class KnownFacts:
    """Used by the visitor's thread alone."""

    def __init__(self, catalogue: VisitorCatalogue, uploads: VisitorUploads | None) -> None:
        self._catalogue = catalogue
        self._uploads = uploads
        self._facts: Facts | None = None
        self._looked_at = 0.0
        self._share: float | None = None
        self.has_live = catalogue.live(None) is not None
        """Whether there is a live source."""

    def of(self, state: ViewState) -> Facts:
        """What is known; asked now if it is about another recording or network."""
        facts = self._facts
        if facts is None or (facts.recording_id, facts.model_id) != (state.recording_id, state.model_id):
            facts = self._ask(state)
        return facts

    def look(self, state: ViewState, share: float | None) -> bool:
        """Ask again, if it is due; whether anything has changed. `share`: how much of the file is indexed."""
        has_grown, self._share = share != self._share, share
        return self._has_changed(state) or has_grown

    def _has_changed(self, state: ViewState) -> bool:
        if self._facts is not None and time.monotonic() - self._looked_at < LOOK_EVERY:
            return False
        before = self._facts
        return self._ask(state) != before

    def can_be_stated(self, recording_id: str) -> bool:
        """Whether the visitor may say of any recording what its file does not."""
        return self._catalogue.can_be_stated(recording_id)

    def live(self, shown_index: int | None) -> LiveShown | None:
        """How the live source fares, which changes all the time."""
        return self._catalogue.live(shown_index)

    def film(self, state: ViewState) -> VideoShown | None:
        """How far the current video is by now."""
        return self._catalogue.film(state.recording_id)

    def forget(self) -> None:
        """Something was done that changes the catalogue: it is asked with the next picture."""
        self._facts = None

    def _ask(self, state: ViewState) -> Facts:
        catalogue = self._catalogue
        self._looked_at = time.monotonic()
        self._facts = Facts(
            recording_id=state.recording_id,
            model_id=state.model_id,
            model=facts_of(catalogue.model(state.model_id)),
            recordings=tuple(
                Choice(entry.id, entry.title, entry.subtitle, catalogue.facts(entry), catalogue.is_film(entry.id))
                for entry in catalogue.entries()
            ),
            models=tuple(
                Choice(entry.id, entry.title, entry.subtitle, source=source_of(entry)) for entry in catalogue.models()
            ),
            growing=catalogue.growing(),
            video=catalogue.film(state.recording_id),
            file_name=catalogue.file_name(state.recording_id),
            can_be_stated=catalogue.can_be_stated(state.recording_id),
            can_be_binned=catalogue.can_be_binned(state.recording_id),
            uploads=None if self._uploads is None else self._uploads.shown,
        )
        return self._facts


def facts_of(entry: ModelEntry) -> ModelFacts:
    """Name, trained band, card, tone, and what the command line calls it."""
    return ModelFacts(
        entry.title,
        entry.trained_band,
        entry.card,
        entry.is_linear_light,
        source_of(entry),
        entry.architecture,
        entry.is_untrained,
    )


def source_of(entry: ModelEntry) -> str:
    """What the command line calls a network: a bundled one's name, or its file's, never where that lies."""
    return entry.source if isinstance(entry.source, str) else entry.source.name
