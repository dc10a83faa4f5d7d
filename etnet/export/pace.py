"""When each frame is shown: windows need not be equally long, videos have one rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from etnet.errors import EtnetError
from etnet.windows import Window

EVENNESS = 0.1
"""Windows whose lengths differ by less than this share of their mean are shown one after the other."""
SLOWEST, FASTEST = 1.0, 60.0
"""Frames a second that players keep up with."""
RESAMPLED = 30.0
"""Frames a second where windows are uneven or too slow, unless they come faster themselves."""


@dataclass(frozen=True, slots=True)
class Pace:
    """`repeats[i]` times window i of the range is shown (0: left out), at `frames_per_second`."""

    repeats: tuple[int, ...]
    frames_per_second: float


def check_speed(speed: float) -> None:
    """An error unless a video can play at this share of real time."""
    if not 0 < speed < math.inf:
        raise EtnetError(f"speed is {speed:g}; it takes a number above 0 (1 is real time, 0.1 ten times slower)")


def pace_of(
    windows: Sequence[Window], speed: float = 1.0, fastest: float = FASTEST, frames_per_second: float | None = None
) -> Pace:
    """Show `windows` at `speed` times real time, at most `fastest` frames a second.

    Even windows are shown once each, unless `frames_per_second` is given. Else a clock runs at a constant rate, and
    each tick shows the newest frame whose stamp is not after it.
    """
    check_speed(speed)
    if frames_per_second is not None and not SLOWEST <= frames_per_second <= fastest:
        raise EtnetError(f"{frames_per_second:g} frames a second; it takes {SLOWEST:g} … {fastest:g}")
    if len(windows) < 2:
        return Pace((1,) * len(windows), 25.0)
    stamps = np.array([window.t_stop for window in windows], np.int64)
    gaps = np.diff(stamps)
    duration = max(int(stamps[-1] - stamps[0]), 1) / 1e6 / speed
    rate = (len(windows) - 1) / duration
    is_even = np.abs(gaps - gaps.mean()).max() <= EVENNESS * gaps.mean()
    if frames_per_second is None and is_even and SLOWEST <= rate <= fastest:
        return Pace((1,) * len(windows), rate)
    ticked = frames_per_second or min(max(rate, RESAMPLED), fastest)
    clock = stamps[0] + np.arange(round(duration * ticked) + 1) * (speed * 1e6 / ticked)
    shown = np.searchsorted(stamps, clock + 0.5, side="right") - 1
    return Pace(tuple(int(n) for n in np.bincount(shown, minlength=len(windows))), ticked)
