"""A patch followed along the motion of the events: where the thing under a pixel was, and where it goes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from cv2 import GaussianBlur
from jaxtyping import Float64

from etnet.events.events import Events
from etnet.events.recording import Recording
from etnet.inspection.pyramid import give_up_if
from etnet.windows import Window

FEWEST_EVENTS = 30
"""With fewer in the patch its motion is not estimated: the place stays."""
BLUR = 0.7
"""σ of the blur of an events' image, pixels."""
TIE = 0.5
"""Weight of the expected shift, which is the one before: what a shift's sharpness loses, as a share of the unmoved
image's, where it lies `reach` away from it."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the patch lies at the stamp of one window."""

    index: int
    x: float
    y: float
    moved: tuple[float, float]
    """Pixels from the place before, (x, y)."""
    num_events: int
    """Events that told the motion."""
    sharpness: float
    """How much sharper the events' image is along the motion than without it (variance, a ratio); 1 says nothing."""

    @property
    def pixel(self) -> tuple[int, int]:
        """The nearest pixel."""
        return round(self.x), round(self.y)


def follow(
    recording: Recording,
    windows: Sequence[Window],
    index: int,
    pixel: tuple[int, int],
    until: int,
    radius: int = 20,
    reach: int = 12,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[Place]:
    """Follow the patch that lies at `pixel` at the stamp of window `index` to window `until`, forwards or backwards.

    Between two stamps the motion is the shift, up to `reach` pixels to each side, along which the events within
    `radius` pixels line up best (the variance of their image, as in contrast maximisation, Gallego et al. 2018). It
    ends early where the patch leaves the sensor. Errors add up: read `sharpness` and `num_events`.
    """
    sensor = recording.sensor
    x, y = map(float, pixel)
    if not (0 <= x < sensor.width and 0 <= y < sensor.height):
        raise ValueError(f"pixel {pixel} lies outside the sensor of {sensor}")
    shift = (0.0, 0.0)
    yield Place(index, x, y, shift, 0, 1.0)
    step = 1 if until >= index else -1
    for there in range(index + step, until + step, step):
        give_up_if(cancelled, "this path")
        window = windows[max(there, there - step)]  # the events between the two stamps
        reference, other = windows[there - step].t_stop, windows[there].t_stop
        events = _near(recording.read(window.start, window.stop), x, y, radius + reach)
        shift, num_events, sharpness = motion(events, (x, y), reference, other, radius, reach, shift)
        x, y = x + shift[0], y + shift[1]
        if not (-0.5 <= x < sensor.width - 0.5 and -0.5 <= y < sensor.height - 0.5):
            return
        yield Place(there, x, y, shift, num_events, sharpness)


def pixels_of(places: Iterable[Place]) -> dict[int, tuple[int, int]]:
    """A pixel for each window: what `attention_through_time` takes as its query."""
    return {place.index: place.pixel for place in places}


def motion(
    events: Events,
    centre: tuple[float, float],
    reference: int,
    other: int,
    radius: int,
    reach: int,
    expected: tuple[float, float] = (0.0, 0.0),
) -> tuple[tuple[float, float], int, float]:
    """The shift (x, y) in pixels from stamp `reference` to stamp `other` of what lies at `centre` at `reference`; the
    events near it; and how much sharper their image is along it. Where the events do not tell, along a straight edge,
    the shift stays near the `expected` one.
    """
    x, y = events.x - centre[0], events.y - centre[1]
    phase = (events.t - reference) / (other - reference) if other != reference else np.zeros(len(events))
    if int((np.hypot(x, y) <= radius).sum()) < FEWEST_EVENTS or other == reference:
        return (0.0, 0.0), int((np.hypot(x, y) <= radius).sum()), 1.0
    still = _sharpness(x, y, phase, np.zeros(2), radius)
    best, found, highest = np.zeros(2), still, -np.inf
    for spacing in (2.0, 0.5, 0.25):
        steps = np.arange(-reach, reach + 1e-9, spacing) if spacing == 2 else spacing * np.arange(-4, 5)
        around = best
        for shift in ((dx, dy) for dx in steps for dy in steps):
            tried = np.clip(around + shift, -reach, reach)
            sharpness = _sharpness(x, y, phase, tried, radius)
            score = sharpness - TIE * still * float(((tried - expected) ** 2).sum()) / reach**2
            if score > highest:
                best, found, highest = tried, sharpness, score
    inside = np.hypot(x - phase * best[0], y - phase * best[1]) <= radius
    return (float(best[0]), float(best[1])), int(inside.sum()), found / still if still else 1.0


def _sharpness(
    x: Float64[np.ndarray, " n"],
    y: Float64[np.ndarray, " n"],
    phase: Float64[np.ndarray, " n"],
    shift: Float64[np.ndarray, " 2"],
    radius: int,
) -> float:
    """Variance over mean of the image of the events moved back by their share of `shift`, within the patch.

    Divided by the mean, so that a shift that brings in more events is not preferred for that.
    """
    side = 2 * radius + 1
    column, row = x - phase * shift[0] + radius, y - phase * shift[1] + radius
    inside = (column > 0) & (column < side - 1) & (row > 0) & (row < side - 1)
    column, row = column[inside], row[inside]
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right, below = column - left, row - top
    image = np.zeros(side * side)
    for dx, wx in ((0, 1 - right), (1, right)):
        for dy, wy in ((0, 1 - below), (1, below)):
            image += np.bincount((top + dy) * side + left + dx, wx * wy, minlength=side * side)
    # Unblurred, a shift that leaves events on whole pixels looks sharper than one that lays them between two.
    image = GaussianBlur(image.reshape(side, side), (5, 5), BLUR)
    mean = image.mean()
    return float(image.var() / mean) if mean > 0 else 0.0


def _near(events: Events, x: float, y: float, distance: int) -> Events:
    apart_x, apart_y = np.abs(events.x - float(x)), np.abs(events.y - float(y))
    here = np.flatnonzero((apart_x <= distance) & (apart_y <= distance))
    return Events(events.x[here], events.y[here], events.t[here], events.p[here], events.sensor)
