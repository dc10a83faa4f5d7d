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
_Key = tuple[Recording, Cleaning]


class CleanedRecordings:
    """Safe from every thread. Who asks for one that is being made waits for it, and for no other."""

    def __init__(self) -> None:
        self._made: OrderedDict[_Key, Recording] = OrderedDict()
        self._making: dict[_Key, Lock] = {}
        self._lock = Lock()

    def of(self, recording: Recording, cleaning: Cleaning) -> Recording:
        """`recording` after `cleaning`; raises RecordingError as `cleaned` does."""
        if cleaning.changes_nothing:
            return recording
        if is_live(recording):
            raise RecordingError("noise is taken out of whole recordings; record, and open the file")
        key = (recording, cleaning)
        with self._lock:
            making = self._making.setdefault(key, Lock())
        with making:
            made = None
            try:
                if (made := self._find(key)) is None:
                    made = cleaned(recording, cleaning)
                return made
            finally:
                self._end(key, making, made)

    def forget(self, recording: Recording) -> None:
        """Forget what was made of a recording."""
        with self._lock:
            for held in self._made, self._making:
                for key in [key for key in held if key[0] is recording]:
                    del held[key]

    def _find(self, key: _Key) -> Recording | None:
        with self._lock:
            if key in self._made:
                self._made.move_to_end(key)
            return self._made.get(key)

    def _end(self, key: _Key, making: Lock, made: Recording | None) -> None:
        with self._lock:
            if self._making.get(key) is not making:
                return  # it was forgotten meanwhile, or is held by now
            del self._making[key]
            if made is not None:
                self._made[key] = made
            while len(self._made) > KEPT:
                self._made.popitem(last=False)
