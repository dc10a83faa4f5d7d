"""Events counted pixel by pixel, and the pixels that stand out. A vast sensor is counted in cells of many pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording

LARGEST_COUNTED = 1 << 23
"""Pixels that are counted one by one: 64 MB of counts, for a sensor simulated from 4K video. The largest sensor built
has an eighth of it; a text of four lines can declare five hundred times as many."""

HOT_FACTOR = 10
"""A pixel is hot if it has this many times the events of the busiest of its eight neighbours."""

_HOT_SHARE = 1e-4


@dataclass(frozen=True, slots=True)
class HotPixel:
    """A pixel that fires far more than its neighbours."""

    x: int
    y: int
    num_events: int


class PixelCounts:
    """Events per cell of `cell` × `cell` pixels: per pixel, unless there are more than `LARGEST_COUNTED`."""

    def __init__(self, sensor: Sensor) -> None:
        self.cell = math.isqrt((sensor.num_pixels - 1) // LARGEST_COUNTED) + 1
        # Rounded up, the cells at two borders of a long and narrow sensor can be one line too many.
        while _num_cells(sensor, self.cell) > LARGEST_COUNTED:
            self.cell += 1
        self.image: Int64[np.ndarray, "h w"] = np.zeros(
            (-(-sensor.height // self.cell), -(-sensor.width // self.cell)), np.int64
        )

    def add(self, events: Events) -> None:
        """Take in some events."""
        height, width = self.image.shape
        places = (events.y // self.cell).astype(np.int64) * width + events.x // self.cell
        self.image += np.bincount(places, minlength=self.image.size).reshape(height, width)


def _num_cells(sensor: Sensor, cell: int) -> int:
    return -(-sensor.height // cell) * -(-sensor.width // cell)


def check_countable(recording: Recording) -> None:
    """An error where something is to be known of each pixel and there are too many."""
    if recording.sensor.num_pixels > LARGEST_COUNTED:
        raise RecordingError(
            f"{recording.name}: a sensor of {recording.sensor} has more than the {LARGEST_COUNTED:,} pixels that are "
            "looked at one by one; look at a region, or state the size with --assume width=…,height=…"
        )


def outstanding(image: Int64[np.ndarray, "h w"]) -> tuple[HotPixel, ...]:
    """The pixels that fire `HOT_FACTOR` times more than the busiest of their neighbours, the worst first."""
    padded = np.pad(image, 1)
    height, width = image.shape
    around = np.zeros_like(image)
    for down in range(3):
        for right in range(3):
            if (down, right) != (1, 1):
                around = np.maximum(around, padded[down : down + height, right : right + width])
    is_hot = (image >= HOT_FACTOR * (around + 1)) & (image >= _HOT_SHARE * image.sum())
    rows, columns = np.nonzero(is_hot)
    found = [HotPixel(int(x), int(y), int(image[y, x])) for y, x in zip(rows, columns, strict=True)]
    return tuple(sorted(found, key=lambda pixel: -pixel.num_events))
