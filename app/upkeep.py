"""What a server that runs for days does about its memory. Only glibc needs it, and only glibc is asked."""

from __future__ import annotations

import ctypes
import time

M_ARENA_MAX = -8
ARENAS = 2
"""Every visitor has a thread, and glibc would keep what each of them has freed in a store of its own."""
BETWEEN_TRIMS = 20.0
"""Seconds."""

_trimmed_at = 0.0


def share_arenas() -> bool:
    """Let all threads that start from now on share their free memory; whether this system can."""
    tune = _libc("mallopt")
    return tune is not None and bool(tune(M_ARENA_MAX, ARENAS))


def give_back() -> None:
    """Return free memory to the system, not more often than useful. Called when a visitor has gone."""
    global _trimmed_at
    trim, now = _libc("malloc_trim"), time.monotonic()
    if trim is not None and now - _trimmed_at > BETWEEN_TRIMS:
        _trimmed_at = now
        trim(0)


def _libc(name: str):
    try:
        return getattr(ctypes.CDLL(None), name, None)
    except (OSError, TypeError):
        return None  # a system without one C library for the whole process
