"""How many pixels a side become one, so that a network keeps up with a recording and a page can show it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from etnet.events.events import Sensor
from etnet.events.opened_as import View
from etnet.events.pixel_counts import LARGEST_COUNTED
from etnet.events.recording import Recording, Remark
from etnet.events.view import seen_whole

RUNNABLE_PIXELS = 160_000
"""Above it a step of the default network takes seconds on two cores; 480×320 is below, 640×480 above."""
_LARGEST_FACTOR = 4
"""What a view joins at once."""


def opened_to_fit(opened: Callable[[View], Recording], seen: View, is_asked: bool) -> tuple[Recording, Remark | None]:
    """The recording, and a word where more of its pixels are joined than `seen` says.

    `is_asked`: somebody asked for this view, so a network may take its time; a page still has to show it.
    """
    recording = opened(seen)
    whole = recording.sensor
    factor = (shown_downsample if is_asked else runnable_downsample)(whole.num_pixels)
    if factor == 1:
        return recording, None
    joined = factor * seen.downsample
    first = min(joined, _LARGEST_FACTOR)
    if first != seen.downsample:
        recording.close()
        recording = opened(replace(seen, downsample=first))
    if joined > first:
        while joined > first:
            recording = seen_whole(View(downsample=2), recording)
            joined //= 2
        # Nothing that is kept of a page has a name for more.
        recording = replace(recording, opened_as=None)
    return recording, _remark(whole, factor)


def runnable_downsample(num_pixels: int) -> int:
    """The least downsampling that brings a sensor to a size that runs; from 4 on to four times that size."""
    if num_pixels <= RUNNABLE_PIXELS:
        return 1
    return 2 if num_pixels <= 4 * RUNNABLE_PIXELS else max(4, _downsample_to(4 * RUNNABLE_PIXELS, num_pixels))


def shown_downsample(num_pixels: int) -> int:
    """The least downsampling that brings a sensor to a size that a page can show, whoever asks for every pixel."""
    return _downsample_to(LARGEST_COUNTED, num_pixels)


def _downsample_to(most: int, num_pixels: int) -> int:
    factor = 1
    while num_pixels > most * factor**2:
        factor *= 2
    return factor


def _remark(whole: Sensor, factor: int) -> Remark:
    binned = f"binned {factor}×{factor} of {whole}"
    if shown_downsample(whole.num_pixels) > 1:
        return Remark("assumed", f"{binned}: at most {LARGEST_COUNTED:,} pixels are shown; --roi shows a part of them")
    return Remark("assumed", f"{binned} so that the network keeps up; --downsample 1 shows every pixel")
