"""Longer questions to the model: answers that grow while nobody waits for a frame.

A job is a value, like a request: equal jobs have equal answers, which visitors share. It runs on the engine's
thread as an iterator, one short stretch at a time; between two stretches requests are granted.
"""

from __future__ import annotations

import logging
import time
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from threading import Condition
from typing import Any, Protocol

from app.catalogue.recording_id import is_of
from app.engine.failures import in_words
from app.engine.playbacks import LoadedPlayback, PlaybackCache
from app.engine.requests import FrameRequest
from etnet.byte_cache import ByteCache
from etnet.errors import Cancelled, ModelError, RecordingError

KEPT_BYTES = 64 << 20
"""Whole answers that are kept for who asks again; the oldest go."""
GRANTS = 3
"""Requests that are served between two stretches of a file that was ordered, where somebody always waits: among twenty
visitors whose recordings play it would never be made."""
STRETCH = 0.4
"""Seconds after which such a stretch makes way."""

_log = logging.getLogger(__name__)


class Job(Hashable, Protocol):
    """A question about one moment, or about a stretch of a recording. Frozen; `slots=True` dataclasses do."""

    @property
    def request(self) -> FrameRequest:
        """The moment it is about: whose playback it needs."""
        ...

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[object, float]]:
        """The answer so far and the share done (0 … 1), again and again; the last one is whole.

        Each stretch between two yields should be about one decode long. A job that replays passes `cancelled` on; a
        `Cancelled` that comes out restarts the job later, when the states that were laid make it shorter.
        """
        ...


def is_ordered(job: Job) -> bool:
    """Whether it makes a file that a person ordered and waits for, whatever plays meanwhile: the job says so itself."""
    return bool(getattr(job, "is_ordered", False))


@dataclass(frozen=True, slots=True, eq=False)
class JobResult:
    """What is known of a job. `value` is `None` before anything is; `trouble` says why it never will be."""

    job: Job
    value: Any = None
    share: float = 0.0
    is_whole: bool = False
    trouble: str = ""


Tell = Callable[[str, JobResult], None]
"""Told the slot and the result, on the engine's thread (at once, on the asker's, when the answer is known)."""


@dataclass(eq=False, slots=True)
class _Entry:
    job: Job
    tell: Tell
    answers: Iterator[tuple[object, float]] | None = None
    newest: tuple[object, float] = (None, 0.0)
    is_of_part: bool = False
    """Whether the recording was still being made when it began."""
    has_begun_anew: bool = False


class JobQueue:
    """One job a visitor and slot; a newer one replaces it. Slots take turns."""

    def __init__(self, playbacks: PlaybackCache, changed: Condition) -> None:
        self._playbacks = playbacks
        self._changed = changed
        self._entries: OrderedDict[tuple[str, str], _Entry] = OrderedDict()
        self._kept: ByteCache[Job, JobResult] = ByteCache(KEPT_BYTES, overhead=0)
        self._num_granted, self._num_ordered = 0, 0
        self._must_yield: Callable[[], bool] = lambda: False

    def put(self, visitor: str, slot: str, job: Job, tell: Tell) -> None:
        """Ask; what stood in the slot is forgotten. An answer that is known comes at once."""
        with self._changed:
            former = self._entries.pop((visitor, slot), None)
            known = self._kept.find(job)
            if known is None:
                self._entries[visitor, slot] = _Entry(job, tell)
                self._changed.notify_all()
        _end(former)
        if known is not None:
            _tell(tell, slot, known)

    def drop(self, visitor: str, slot: str | None = None) -> None:
        """Forget one question of a visitor, or all of them."""
        with self._changed:
            keys = [key for key in self._entries if key[0] == visitor and slot in (None, key[1])]
            dropped = [self._entries.pop(key) for key in keys]
        for entry in dropped:
            _end(entry)

    def forget(self, recording_id: str) -> None:
        """Forget every answer about a recording."""
        self._kept.forget(lambda job: is_of(job.request.recording_id, recording_id))

    @property
    def num_waiting(self) -> int:
        """Jobs that are not whole yet."""
        with self._changed:
            return len(self._entries)

    def note_granted(self) -> None:
        """A request was served. Called on the engine's thread."""
        self._num_granted += 1

    @property
    def is_owed(self) -> bool:
        """Whether a file that was ordered has waited for its turn while `GRANTS` requests were served."""
        with self._changed:
            ordered = any(is_ordered(entry.job) for entry in self._entries.values())
            return ordered and self._num_granted >= GRANTS

    def work(self, is_wanted_elsewhere: Callable[[], bool]) -> None:
        """One stretch of the job whose turn it is. Called on the engine's thread alone."""
        is_owed, ends = self.is_owed, time.monotonic() + STRETCH
        with self._changed:
            waiting = ((key, entry) for key, entry in self._entries.items() if not is_owed or is_ordered(entry.job))
            key, entry = next(waiting, (None, None))
            if key is None or entry is None:
                return
            self._entries.move_to_end(key)
            if is_ordered(entry.job):
                key, entry = self._order_next(key, entry)
        self._num_granted = 0
        self._must_yield = lambda: is_wanted_elsewhere() and not (is_owed and time.monotonic() < ends)
        try:
            self._advance(key, entry)
        except Cancelled:
            entry.answers = None
        except Exception as error:
            if not isinstance(error, RecordingError) or not self._begins_anew(entry):
                self._settle(key, entry, JobResult(entry.job, trouble=in_words(error, entry.job)))
        finally:
            if not self._holds(key, entry):
                _end(entry)

    def _order_next(self, key: tuple[str, str], entry: _Entry) -> tuple[tuple[str, str], _Entry]:
        """Of all files that were ordered every second stretch goes to the one nearest to its end: in turns alone all of
        them would be there when the last one is."""
        self._num_ordered += 1
        if self._num_ordered % 2:
            return key, entry
        ordered = ((key, entry) for key, entry in self._entries.items() if is_ordered(entry.job))
        return max(ordered, key=lambda item: item[1].newest[1])

    def _advance(self, key: tuple[str, str], entry: _Entry) -> None:
        if entry.answers is None:
            self._playbacks.start()
            loaded = self._playbacks.whole(entry.job.request)
            _check_index(entry.job.request, loaded)
            entry.is_of_part = loaded.playback.recording.latest is not None
            entry.answers = entry.job.run(loaded, lambda: self._must_yield() or not self._holds(key, entry))
        answer = next(entry.answers, None)
        if answer is not None:
            entry.newest = answer
            if answer[1] < 1.0:
                if self._holds(key, entry):
                    _tell(entry.tell, key[1], JobResult(entry.job, *answer))
                return
        value, _ = entry.newest
        result = JobResult(entry.job, value, 1.0, is_whole=True)
        # Of what is forgotten no answer is kept, nor a file of what is longer when it is ordered again.
        is_outgrown = entry.is_of_part and is_ordered(entry.job)
        if self._playbacks.held(entry.job.request) is not None and not is_outgrown:
            self._kept.keep(result.job, result, num_bytes(value))
        self._settle(key, entry, result)

    def _begins_anew(self, entry: _Entry) -> bool:
        """Whether events on the way have left a live recording's buffer: the job begins again, once, and cold."""
        request = entry.job.request
        loaded = self._playbacks.held(request)
        if entry.has_begun_anew or loaded is None or loaded.reaches(request.index):
            return False
        entry.answers, entry.has_begun_anew = None, True
        return True

    def _holds(self, key: tuple[str, str], entry: _Entry) -> bool:
        with self._changed:
            return self._entries.get(key) is entry

    def _settle(self, key: tuple[str, str], entry: _Entry, result: JobResult) -> None:
        with self._changed:
            if self._entries.get(key) is not entry:
                return
            del self._entries[key]
        _tell(entry.tell, key[1], result)


def _end(entry: _Entry | None) -> None:
    """Drop an iterator that refers to its entry, so that what it holds ends now and not with the next sweep."""
    if entry is not None:
        entry.answers = None


def num_bytes(value: object) -> int:
    """The bytes of all arrays and tensors in a value, through dataclasses, mappings and sequences; 64 for the rest."""
    if isinstance(value, bytes | bytearray):
        return len(value)
    if (size := getattr(value, "nbytes", None)) is not None:
        return int(size)
    if is_dataclass(value):
        return sum(num_bytes(getattr(value, entry.name)) for entry in fields(value))
    if isinstance(value, dict):
        return sum(num_bytes(item) for item in value.values())
    if isinstance(value, list | tuple | set | frozenset):
        return sum(num_bytes(item) for item in value)
    return 64


def _check_index(request: FrameRequest, loaded: LoadedPlayback) -> None:
    if not 0 <= request.index < len(loaded.windows):
        raise ModelError(f"window {request.index} does not exist; this plan has {len(loaded.windows)}")


def _tell(tell: Tell, slot: str, result: JobResult) -> None:
    try:
        tell(slot, result)
    except Exception:
        _log.info("a result could not be delivered", exc_info=True)
