"""Addresses whose pages are cut off again and again: the next ones from there wait, one after the other.

A page costs a session, so one that comes, sends what no page sends and comes again would keep a core busy. Nobody is
refused for it: behind one address a whole school may sit.
"""

from __future__ import annotations

import time
from collections import OrderedDict, deque
from collections.abc import Callable

A_MINUTE = 60.0
FREE = 5
"""Pages of one address that may be cut off within a minute before the next ones wait."""
STEP, LONGEST_GAP = 0.1, 2.0
"""Seconds from page to page: so many more for each that was cut off, and at most."""
LONGEST_QUEUE = 20.0
"""Seconds that a page waits; one that would wait longer is not let in."""
KEPT_ADDRESSES = 2000


class CutOffs:
    """Counts pages that were cut off. Used on the server's event loop alone."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._by_address: OrderedDict[str, deque[float]] = OrderedDict()
        self._next: dict[str, float] = {}

    def note(self, address: str) -> None:
        """A page from this address was cut off."""
        self._by_address.setdefault(address, deque(maxlen=FREE + round(LONGEST_GAP / STEP))).append(self._clock())
        self._by_address.move_to_end(address)
        while len(self._by_address) > KEPT_ADDRESSES:
            gone, _ = self._by_address.popitem(last=False)
            self._next.pop(gone, None)

    def wait_of(self, address: str) -> float | None:
        """Seconds that a new page from this address waits; `None`: too many wait already."""
        now = self._clock()
        num_lately = sum(stamp > now - A_MINUTE for stamp in self._by_address.get(address, ()))
        if num_lately <= FREE:
            return 0.0
        gap = min(STEP * (num_lately - FREE), LONGEST_GAP)
        begins = max(now, self._next.get(address, now)) + gap
        if begins - now > LONGEST_QUEUE:
            return None
        self._next[address] = begins
        return begins - now
