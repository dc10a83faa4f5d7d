"""Threads that are used again: what a library keeps for a thread, it may keep for ever.

OpenCV 5.0 holds 880 bytes of every thread that ever drew with it, whether it still runs or not. Every visit has a
thread, so a server that runs for days would grow by what is left of its visitors.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Event, Lock, Thread, current_thread

MOST_IDLE = 32
"""Threads that wait for work; one that finds so many waiting already ends."""
KEPT_IDLE = 4
"""Threads that wait for as long as the process lives; those of a crowd that has gone end after `PATIENCE`."""
PATIENCE = 20.0
"""Seconds."""
MOST_IN_ORDER = 200
"""Pieces of work that wait for one another."""
IDLE = "idle"
"""The name of a thread that waits."""

_log = logging.getLogger(__name__)
Work = Callable[[], object]
_Mail = SimpleQueue[tuple[Work, str, Event]]


class ThreadPool:
    """Starts work on a thread that waits, or on a new one. Safe from all threads."""

    def __init__(self, most_idle: int = MOST_IDLE, kept_idle: int = KEPT_IDLE, patience: float = PATIENCE) -> None:
        self._most_idle = most_idle
        self._kept_idle = kept_idle
        self._patience = patience
        self._idle: list[_Mail] = []
        self._lock = Lock()

    def start(self, work: Work, name: str) -> Event:
        """Do `work` beside the caller; the event is set when it has ended, well or not.

        `name` is the thread's while it lasts. The process does not wait for it. An error that comes out of `work`
        goes where a thread's errors go (`threading.excepthook`) and ends the thread.
        """
        ended = Event()
        with self._lock:
            # The one that has waited for the shortest time: when a crowd has gone, most of its threads stay asleep.
            mail = self._idle.pop() if self._idle else None
        if mail is None:
            mail = _Mail()
            Thread(target=self._serve, args=(mail,), daemon=True, name=IDLE).start()
        mail.put((work, name, ended))
        return ended

    def _serve(self, mail: _Mail) -> None:
        while True:
            try:
                _do(*mail.get(timeout=self._patience))
            except Empty:
                if self._may_end(mail):
                    return
                continue
            with self._lock:
                if len(self._idle) >= self._most_idle:
                    return
                self._idle.append(mail)

    def _may_end(self, mail: _Mail) -> bool:
        """Whether a thread that waited in vain ends: more than enough wait, and no work is on its way to it."""
        with self._lock:
            if mail not in self._idle or len(self._idle) <= self._kept_idle:
                return False
            self._idle.remove(mail)
            return True


class InOrder:
    """Does one piece of work after the other, in the order in which it is given, beside the caller."""

    def __init__(self, name: str, most: int = MOST_IN_ORDER) -> None:
        self._name = name
        self._most = most
        self._waiting: deque[Work] = deque()
        self._is_working = False
        self._lock = Lock()

    def start(self, work: Work) -> bool:
        """Whether it will be done: not where too much waits already."""
        with self._lock:
            if len(self._waiting) >= self._most:
                return False
            self._waiting.append(work)
            if self._is_working:
                return True
            self._is_working = True
        THREADS.start(self._work, self._name)
        return True

    def _work(self) -> None:
        while True:
            with self._lock:
                if not self._waiting:
                    self._is_working = False
                    return
                work = self._waiting.popleft()
            try:
                work()
            except Exception:
                _log.exception("%s failed", self._name)


def _do(work: Work, name: str, ended: Event) -> None:
    """In a function of its own, so that a thread that waits refers to nothing of what it did.

    A thread that ends with an error keeps its name, which says whose error it was.
    """
    current_thread().name = name
    try:
        work()
        current_thread().name = IDLE
    finally:
        ended.set()


THREADS = ThreadPool()
"""The process's own."""
