"""What a server that runs for days does about its memory. Only glibc needs to be told, and only glibc is asked."""

from __future__ import annotations

import asyncio
import ctypes
import gc
import time
from collections.abc import Callable

M_ARENA_MAX = -8
ARENAS = 2
"""Every visitor has a thread, and glibc would keep what each of them has freed in a store of its own."""
SETTLE = 2.0
"""Seconds after which the thread of a visitor who has left has ended, too."""
BETWEEN = 20.0
"""Seconds from one sweep to the next: a sweep holds up all threads for 0.3 s where both of two cores are busy."""
TRIM_EVERY = 30.0
"""Seconds while anybody is here. What a network's steps have freed lies between what is kept; with eight visitors of a
demo that was 250 MB, which only a trim gives back. It holds up nobody but who allocates just then."""


def share_arenas() -> bool:
    """Let all threads that start from now on share their free memory; whether this system can."""
    tune = _libc("mallopt")
    return tune is not None and bool(tune(M_ARENA_MAX, ARENAS))


def give_back() -> None:
    """Return to the system what nobody uses.

    A page's widgets and callbacks refer to each other, with the pictures and maps it showed. Python looks for such
    circles only when a quarter of all its objects are new, which takes a dozen visits.
    """
    gc.collect()
    trim()


def trim() -> None:
    """Return to the system what was freed and is kept for later."""
    if (ask := _libc("malloc_trim")) is not None:
        ask(0)


class IdleMemory:
    """Sweeps up after visitors: always once after the last one has gone, never more often than useful.

    While anybody is here, what was freed is given back now and then.
    """

    def __init__(
        self,
        sweep: Callable[[], None] = give_back,
        settle: float = SETTLE,
        between: float = BETWEEN,
        trim: Callable[[], None] = trim,
        trim_every: float = TRIM_EVERY,
    ) -> None:
        self._sweep, self._trim = sweep, trim
        self._settle, self._between, self._trim_every = settle, between, trim_every
        self._is_waiting = self._trims = False
        self._swept_at = -between

    def while_here(self, is_anybody: Callable[[], bool]) -> None:
        """Somebody has come. Called on an event loop."""
        if not self._trims:
            self._trims = True
            asyncio.get_running_loop().call_later(self._trim_every, self._trim_on, is_anybody)

    def _trim_on(self, is_anybody: Callable[[], bool]) -> None:
        self._trims = False
        if is_anybody():
            asyncio.get_running_loop().run_in_executor(None, self._trim)
            self.while_here(is_anybody)

    def after_visit(self) -> None:
        """Somebody has left. Called on an event loop; the sweep comes later, in a worker."""
        if self._is_waiting:
            return
        self._is_waiting = True
        loop = asyncio.get_running_loop()
        loop.call_later(max(self._settle, self._swept_at + self._between - time.monotonic()), self._begin, loop)

    def _begin(self, loop: asyncio.AbstractEventLoop) -> None:
        self._is_waiting = False
        self._swept_at = time.monotonic()
        loop.run_in_executor(None, self._sweep)


def _libc(name: str):
    try:
        return getattr(ctypes.CDLL(None), name, None)
    except (OSError, TypeError):
        return None  # a system without one C library for the whole process
