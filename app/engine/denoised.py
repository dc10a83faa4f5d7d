"""Recordings with their noise taken out: each is made once and shared by all who plan or play it."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

from app.catalogue.cut import is_live
from etnet.errors import RecordingError
from etnet.events.denoise import Cleaning, cleaned
from etnet.events.recording import Recording

KEPT = 3
"""Cleaned recordings that are held; each remembers four bytes an event."""


class CleanedRecordings:
    """Safe from every thread."""

    def __init__(self) -> None:
        self._made: OrderedDict[tuple[Recording, Cleaning], Recording] = OrderedDict()
        self._lock = Lock()

    def of(self, recording: Recording, cleaning: Cleaning) -> Recording:
        """`recording` after `cleaning`; raises RecordingError as `cleaned` does."""
        if cleaning.changes_nothing:
            return recording
        if is_live(recording):
            raise RecordingError("noise is taken out of whole recordings; record, and open the file")
        with self._lock:
            key = (recording, cleaning)
            if key not in self._made:
                self._made[key] = cleaned(recording, cleaning)
                while len(self._made) > KEPT:
                    self._made.popitem(last=False)
            self._made.move_to_end(key)
            return self._made[key]

    def forget(self, recording: Recording) -> None:
        """Forget what was made of a recording."""
        with self._lock:
            for key in [key for key in self._made if key[0] is recording]:
                del self._made[key]
