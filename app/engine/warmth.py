"""When a recurrent state is called warm: it has seen enough windows, and enough events in them."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

from etnet.windows import Window

SPARSEST = 0.05
"""Events per pixel of a window that counts as a whole one, for networks whose card says no range."""


def sparsest_of(trained_band: tuple[float, float] | None) -> float:
    """Events per pixel of a window that counts as a whole one, for a network that was trained in this range."""
    return SPARSEST if trained_band is None else trained_band[0]


def windows_seen(
    windows: Sequence[Window], index: int, warm_up: int, num_pixels: int, sparsest: float, first: int = 0
) -> int:
    """How far the state of window `index` is warmed up, 0 … `warm_up`, where it was empty at window `first`.

    Windows count, and so do events: `warm_up` windows hold `sparsest` events per pixel each, or it takes more of them.
    """
    if not first <= index < len(windows):
        return 0
    wanted = warm_up * sparsest * num_pixels
    events = windows[index].start - windows[first].start
    by_events = warm_up if wanted <= 0 else int(warm_up * events / wanted)
    return min(index - first, by_events, warm_up)


def first_warm(windows: Sequence[Window], warm_up: int, num_pixels: int, sparsest: float, first: int = 0) -> int | None:
    """The first window whose state is warm, where it was empty at window `first`; `None` where none is."""

    def is_warm(index: int) -> bool:
        return windows_seen(windows, index, warm_up, num_pixels, sparsest, first) >= warm_up

    found = bisect_left(range(len(windows)), True, key=is_warm)
    return found if found < len(windows) else None


def warm_up_steps(windows: Sequence[Window], warm_up: int, num_pixels: int, sparsest: float) -> tuple[int, ...]:
    """The first windows whose states have seen 1, 2, … `warm_up` windows; fewer where the recording ends before.

    So many of them as are not above an index `windows_seen` counts there: what is known without the windows.
    """
    steps: list[int] = []
    for wanted in range(1, warm_up + 1):
        rest = range(max(wanted, steps[-1] if steps else 0), len(windows))

        def is_reached(index: int, wanted: int = wanted) -> bool:
            return windows_seen(windows, index, warm_up, num_pixels, sparsest) >= wanted

        at_once = bool(rest) and is_reached(rest[0])
        found = 0 if at_once else bisect_left(rest, True, key=is_reached)
        if found >= len(rest):
            break
        steps.append(rest[found])
    return tuple(steps)
