"""The windows between two stamps, and the one nearest to a stamp: what loops, is trimmed out, exported, compared."""

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


def nearest_window(windows: Sequence[Window], t: int) -> int:
    """The window whose frame stamp (`t_stop`) is nearest to `t` µs; the earlier of two equally near."""
    after = bisect.bisect_left(windows, t, key=lambda window: window.t_stop)
    if after in (0, len(windows)):
        return min(after, max(len(windows) - 1, 0))
    earlier, later = windows[after - 1].t_stop, windows[after].t_stop
    return after if later - t < t - earlier else after - 1
