"""What one visitor can open: what everybody can, and the files that he handed over himself."""

from __future__ import annotations

from collections.abc import Callable

from app.catalogue import Catalogue, CatalogueError, Entry, ModelEntry
from app.desk import Desk
from etnet.events.recording import Recording


class OwnCatalogue:
    """The catalogue through one visitor's eyes. Safe from every thread."""

    def __init__(self, shared: Catalogue, desk: Desk | None = None) -> None:
        self._shared = shared
        self._desk = desk

    def entries(self) -> tuple[Entry, ...]:
        """His own files first."""
        return (() if self._desk is None else self._desk.entries) + self._shared.entries()

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
        """The recording of an id, opened on the first call. Raises EtnetError and nothing else."""
        return self._shared.open(self.entry(recording_id).id, progress)
