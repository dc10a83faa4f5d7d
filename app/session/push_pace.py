"""When a page is sent what it shows next: at most 30 times a second, and no faster than its browser paints.

What is sent faster than it can be painted waits in the socket, and a drag then shows what the hand left a second ago.
So the page says what it has painted (`static/page/channel.js`), and at most `MOST_AHEAD` pushes are under way.
"""

from __future__ import annotations

INTERVAL = 1 / 30
"""Seconds between two pushes of pictures and text; the first one after a rest goes at once."""
MOST_AHEAD = 2
"""Pushes under way: while one is painted, the next one is drawn and sent."""
LONGEST_WAIT = 0.3
"""Seconds after which a push goes out though none was painted: a tab in the background paints nothing."""


class PushPace:
    """One visitor's. Times are seconds of any steady clock."""

    def __init__(self) -> None:
        self._at = 0.0
        self._num_sent = 0
        self._num_painted: int | None = None
        """`None` until the page has said so once: what is no browser never does, and is not waited for."""

    def sent(self, now: float) -> int:
        """A push goes out now; returns its number, counted from 1."""
        self._at = now
        self._num_sent += 1
        return self._num_sent

    def painted(self, number: int) -> None:
        """The page says that it has painted push `number`. It is a stranger's word: nothing but the pace follows."""
        if 0 < number <= self._num_sent:
            self._num_painted = max(number, self._num_painted or 0)

    def wait(self, now: float) -> float:
        """Seconds until the next push is due, 0 where it is due now."""
        is_behind = self._num_painted is not None and self._num_sent - self._num_painted >= MOST_AHEAD
        return max(self._at + (LONGEST_WAIT if is_behind else INTERVAL) - now, 0.0)
