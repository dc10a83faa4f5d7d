"""What the list of recordings says of each: sensor, duration, format. Told by whatever was opened, and by a look."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock

from etnet.errors import EtnetError
from etnet.events.recording import Recording

LOOKED_AT = 60
"""Files of a list that are looked at unasked; the others are told of once they were opened."""
_INDEXED = (".h5", ".hdf5")
"""Formats with an index: opened in milliseconds, whatever their size."""


class ListedFacts:
    """By the ids of the list. Safe from every thread."""

    def __init__(self) -> None:
        self._words: dict[str, str] = {}
        self._lock = Lock()

    def note(self, entry_id: str, recording: Recording) -> None:
        """This is what was opened."""
        with self._lock:
            self._words.setdefault(entry_id, words_of(recording))

    def forget(self, entry_id: str) -> None:
        """It is not in the list any more, and nothing of it stays."""
        with self._lock:
            self._words.pop(entry_id, None)

    def of(self, entry_id: str) -> str:
        """In one line; empty for what nobody has opened."""
        with self._lock:
            return self._words.get(entry_id, "")

    def look(self, files: Sequence[tuple[str, Path]], is_over: Callable[[], bool]) -> None:
        """Open and close the files that have an index, one after another, until `is_over`."""
        from etnet.events.open import open_recording

        indexed = [(entry_id, path) for entry_id, path in files if path.suffix.lower() in _INDEXED]
        for entry_id, path in indexed[:LOOKED_AT]:
            if is_over():
                return
            if self.of(entry_id):
                continue
            try:
                with open_recording(path) as recording:
                    self.note(entry_id, recording)
            except (EtnetError, OSError):
                continue  # whoever opens it is told why


def words_of(recording: Recording) -> str:
    """240×180 · 3.40 s · event_utils HDF5."""
    seconds = recording.span.duration / 1e6
    duration = f"{seconds:.2f} s" if seconds < 60 else f"{seconds // 60:.0f} min {seconds % 60:02.0f} s"
    return f"{recording.sensor} · {duration} · {recording.format}"
