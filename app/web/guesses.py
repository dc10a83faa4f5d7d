"""Wrong tokens are slowed: so many a minute from one address, and so many from all addresses together."""

from __future__ import annotations

import time
from collections import OrderedDict, deque
from collections.abc import Callable

A_MINUTE = 60.0
MOST_WRONG = 10
"""Wrong tokens of one address within a minute, after which its tokens are not looked at. Cookies are."""
MOST_WRONG_OF_ALL = 300
KEPT_ADDRESSES = 2000


class Guesses:
    """Counts wrong tokens. Used on the server's event loop alone."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._by_address: OrderedDict[str, deque[float]] = OrderedDict()
        self._all: deque[float] = deque(maxlen=MOST_WRONG_OF_ALL)

    def may_guess(self, address: str) -> bool:
        """Whether a token from this address is looked at now."""
        since = self._clock() - A_MINUTE
        theirs = self._by_address.get(address, ())
        return _num_since(theirs, since) < MOST_WRONG and _num_since(self._all, since) < MOST_WRONG_OF_ALL

    def note_wrong(self, address: str) -> None:
        """A token from this address was wrong."""
        now = self._clock()
        self._all.append(now)
        self._by_address.setdefault(address, deque(maxlen=MOST_WRONG)).append(now)
        self._by_address.move_to_end(address)
        while len(self._by_address) > KEPT_ADDRESSES:
            self._by_address.popitem(last=False)


def _num_since(stamps: deque[float] | tuple[()], since: float) -> int:
    return sum(stamp > since for stamp in stamps)
