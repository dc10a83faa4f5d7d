"""The windows around the current one that curves run over, and where the chosen pixel lies in each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from etnet.errors import ModelError

if TYPE_CHECKING:
    from etnet.playback.playback import Playback

BLOCK = 12
"""Windows: a curve begins and ends at multiples of it, so that a step along it computes nothing again."""
LENGTH = 4 * BLOCK
"""Windows of a curve at most: 12 or more before the current one, 24 or more after it."""
NEAR = 16
"""Pixels to each side of the pixel that count as near it."""

Path = dict[int, tuple[int, int]]
"""A pixel for each window in which the patch lies on the sensor."""


def stretch_of(index: int) -> tuple[int, int]:
    """The first window of a curve around a window, and how many it has at most."""
    return max(0, (index // BLOCK - 1) * BLOCK), LENGTH


def windows_from(playback: Playback, first: int) -> range:
    """The windows of a curve that begins at `first`, or where the playback does."""
    return range(max(first, playback.first), min(first + LENGTH, len(playback)))


def path_of(
    playback: Playback, windows: range, pixel: tuple[int, int], anchor: int | None, cancelled: Callable[[], bool]
) -> Path:
    """Where the query lies in each window: at one pixel, or with the patch that lies there in window `anchor`.

    Raises:
        ModelError: it lies on the sensor in none of them.
    """
    *_, found = paths_of(playback, windows, pixel, anchor, cancelled)
    inside = {index: place for index, place in sorted(found.items()) if index in windows}
    if not inside:
        raise ModelError("the patch has left the image before these windows; choose it again where it is to be seen")
    return inside


def paths_of(
    playback: Playback, windows: range, pixel: tuple[int, int], anchor: int | None, cancelled: Callable[[], bool]
) -> Iterator[Path]:
    """The same as it grows from `anchor` to both ends of the windows, and on the way to them."""
    if anchor is None:
        yield dict.fromkeys(windows, pixel)
        return
    from etnet.inspection.follow import follow

    found: Path = {}
    start = min(anchor, len(playback) - 1)
    for until in dict.fromkeys((windows[-1], windows[0])):
        for place in follow(playback.recording, playback.windows, start, pixel, until, cancelled=cancelled):
            found[place.index] = place.pixel
            yield dict(found)
