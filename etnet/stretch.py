"""The windows between two stamps: what loops, is trimmed out or exported."""

from __future__ import annotations

import bisect
from collections.abc import Sequence

from etnet.windows import Window


def windows_between(windows: Sequence[Window], begin: int | None, end: int | None) -> range:
    """The windows that end after stamp `begin` and not after `end` (µs); `None` is the recording's own end.

    Empty where none ends between the two.
    """
    first = 0 if begin is None else bisect.bisect_right(windows, begin, key=lambda window: window.t_stop)
    stop = len(windows) if end is None else bisect.bisect_right(windows, end, key=lambda window: window.t_stop)
    return range(first, max(first, stop))
