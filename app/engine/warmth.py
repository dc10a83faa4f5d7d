"""When a recurrent state is called warm: it has seen enough windows, and enough events in them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

from etnet.windows import Window

SPARSEST = 0.05
"""Events per pixel of a window that counts as a whole one, for networks whose card says no range."""


def windows_seen(windows: Sequence[Window], index: int, warm_up: int, num_pixels: int, sparsest: float) -> int:
    """How far the state of window `index` is warmed up, 0 … `warm_up`.

    Windows count, and so do events: `warm_up` windows hold `sparsest` events per pixel each, or it takes more of them.
    """
    if not 0 <= index < len(windows):
        return 0
    wanted = warm_up * sparsest * num_pixels
    events = windows[index].start - windows[0].start
    by_events = warm_up if wanted <= 0 else int(warm_up * events / wanted)
    return min(index, by_events, warm_up)


def first_warm(windows: Sequence[Window], warm_up: int, num_pixels: int, sparsest: float) -> int | None:
    """The first window whose state is warm; `None` where none is."""

    def is_warm(index: int) -> bool:
        return windows_seen(windows, index, warm_up, num_pixels, sparsest) >= warm_up

    found = bisect_left(range(len(windows)), True, key=is_warm)
    return found if found < len(windows) else None
