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
_held: OrderedDict[tuple[Recording, Cleaning], Recording] = OrderedDict()
_lock = Lock()


def cleaned_once(recording: Recording, cleaning: Cleaning) -> Recording:
    """`recording` after `cleaning`; raises RecordingError as `cleaned` does. Safe from every thread."""
    if cleaning.changes_nothing:
        return recording
    if is_live(recording):
        raise RecordingError("noise is taken out of whole recordings; record, and open the file")
    with _lock:
        key = (recording, cleaning)
        if key not in _held:
            _held[key] = cleaned(recording, cleaning)
            while len(_held) > KEPT:
                _held.popitem(last=False)
        _held.move_to_end(key)
        return _held[key]


def forget_cleaned(recording: Recording) -> None:
    """Forget what was made of a recording."""
    with _lock:
        for key in [key for key in _held if key[0] is recording]:
            del _held[key]
