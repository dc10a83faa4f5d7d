"""A process that was started to do one thing ends with the one that started it, however that ends."""

from __future__ import annotations

import sys

SIGKILL = 9
_PR_SET_PDEATHSIG = 1


def end_with_parent() -> None:
    """From here on the system ends this process when the thread that started it has ended. Linux alone knows this."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, SIGKILL)
