"""What one visitor can open: what everybody can, and their own uploads."""

from __future__ import annotations

import secrets
from collections.abc import Callable

from app.catalogue.entries import Entry, under_its_name
from app.catalogue.live import LiveFeed, LiveShown
from app.catalogue.models import ModelEntry
from app.catalogue.recordings import Catalogue, CatalogueError
from app.catalogue.videos import VideoShown
from app.catalogue.visitor_uploads import VisitorUploads
from etnet.errors import EtnetError
from etnet.events.recording import Recording


class VisitorCatalogue:
    """The catalogue through one visitor's eyes. Safe from every thread."""

    def __init__(self, shared: Catalogue, desk: VisitorUploads | None = None, is_host: bool = False) -> None:
        """`is_host`: they sit at the machine itself, and may record and change a camera's settings."""
        self._is_host = is_host
        self._shared = shared
        self._desk = desk
        self._visitor = secrets.token_hex(8)
        self._looks_at = ""

    def entries(self) -> tuple[Entry, ...]:
        """Their own files first."""
        return (() if self._desk is None else self._desk.entries) + self._shared.entries()

    def facts(self, entry: Entry) -> str:
        """Sensor, duration and format of an entry, as far as they are known."""
        return self._shared.facts.of(entry.id)

    def growing(self) -> tuple[str, ...]:
        """Names of files in the --data folder that are being written."""
        return self._shared.growing()

    def models(self) -> tuple[ModelEntry, ...]:
        """Everybody's models."""
        return self._shared.models()

    def model(self, model_id: str) -> ModelEntry:
        """The model of an id; an error if there is none."""
        return self._shared.model(model_id)

    def entry(self, recording_id: str) -> Entry:
        """The entry of an id; an error if there is none, or if it is another visitor's."""
        entry = self._shared.entry(recording_id)
        if entry.kind == "upload" and (self._desk is None or entry not in self._desk.entries):
            raise CatalogueError("this recording is not in the catalogue (any more); choose another one")
        return entry

    def open(self, recording_id: str, progress: Callable[[float], None] | None = None) -> Recording:
        """The recording of an id, opened on the first call. Raises EtnetError and nothing else.

        A video has to be begun before (`looks_at`).
        """
        entry = self.entry(recording_id)
        try:
            return self._shared.open(recording_id, progress)
        except EtnetError as error:  # of a film and of a live source as well
            raise under_its_name(error, entry) from error

    def looks_at(self, recording_id: str) -> None:
        """They look at this now: a video is begun under the setting in the id, the former one may end. One that failed
        is begun again.

        Called by the visitor's thread, so that the newest request is the last one.
        """
        if recording_id == self._looks_at and not self._shared.films.has_failed(recording_id):
            return
        self._looks_at = recording_id
        try:
            entry = self.entry(recording_id)
        except CatalogueError:
            return  # the one who opens it is told
        if self._shared.is_film(entry):
            is_strangers = self._shared.is_strangers(entry)
            self._shared.films.begin(
                self._visitor, recording_id, entry.path, entry.title, is_strangers, entry.unpacking
            )
        else:
            self._shared.films.watch(self._visitor, None)

    def can_be_stated(self, recording_id: str) -> bool:
        """Whether they may say of a recording what its file does not; not of one that is gone."""
        try:
            return self._shared.can_be_stated(self.entry(recording_id))
        except CatalogueError:
            return False

    def can_be_binned(self, recording_id: str) -> bool:
        """Whether they may choose how its pixels are binned."""
        try:
            return self._shared.can_be_binned(self.entry(recording_id))
        except CatalogueError:
            return False

    def file_name(self, recording_id: str) -> str:
        """What a recording's file is called where its owner keeps it; empty for one that is gone."""
        try:
            entry = self.entry(recording_id)
        except CatalogueError:
            return ""
        return entry.title if entry.kind == "upload" else "" if entry.kind == "live" else entry.path.name

    def is_film(self, recording_id: str) -> bool:
        """Whether it is a video, of which an event sensor's view is simulated."""
        try:
            return self._shared.is_film(self.entry(recording_id))
        except CatalogueError:
            return False

    def film(self, recording_id: str) -> VideoShown | None:
        """How far a video is simulated; `None` for all that is no video."""
        return self._shared.films.shown(recording_id)

    def live(self, index: int | None) -> LiveShown | None:
        """What is said of the live source, whatever they look at, on a page with window `index`; `None`: no source."""
        feed = self._shared.live
        return None if feed is None else feed.shown(index, self._is_host)

    def live_control(self) -> LiveFeed | None:
        """The live source, for those who may record it and change its settings."""
        return self._shared.live if self._is_host else None

    def close(self) -> None:
        """They have gone."""
        self._shared.films.watch(self._visitor, None)
