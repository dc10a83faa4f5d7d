"""How fast one connection is read: what comes faster stays in its sender's own buffers."""

from __future__ import annotations

import asyncio
import time


class Rate:
    """So many messages a second, and so many at once after a rest. One connection's, on its event loop alone."""

    def __init__(self, a_second: float, burst: float) -> None:
        self._a_second, self._burst = a_second, burst
        self._left, self._counted_at = burst, time.monotonic()

    async def wait(self) -> None:
        """Until one more message may be read."""
        now = time.monotonic()
        self._left = min(self._left + (now - self._counted_at) * self._a_second, self._burst) - 1
        self._counted_at = now
        if self._left < 0:
            await asyncio.sleep(-self._left / self._a_second)
