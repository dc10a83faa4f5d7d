"""The one form in which events travel: four columns and the sensor they came from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int8, Int64, UInt16


@dataclass(frozen=True, slots=True)
class Sensor:
    """The pixel array's size. The origin is top left, x runs right, y runs down."""

    width: int
    height: int

    def __post_init__(self) -> None:
        if not (0 < self.width <= 65_536 and 0 < self.height <= 65_536):
            raise ValueError(f"sensor is {self.width} × {self.height}; each side must be in 1 … 65,536 pixels")

    @property
    def num_pixels(self) -> int:
        """Width × height."""
        return self.width * self.height

    def __str__(self) -> str:
        return f"{self.width}×{self.height}"


@dataclass(frozen=True, slots=True, eq=False)
class Events:
    """`n` events in the order of time: pixel (x, y), stamp t in µs on the file's clock, polarity p ∈ {−1, +1}."""

    x: UInt16[np.ndarray, " n"]
    y: UInt16[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Int8[np.ndarray, " n"]
    sensor: Sensor

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, part: slice) -> Events:
        """A view of some of the events; nothing is copied."""
        return Events(self.x[part], self.y[part], self.t[part], self.p[part], self.sensor)

    @staticmethod
    def empty(sensor: Sensor) -> Events:
        """No events at all."""
        pixels = np.empty(0, np.uint16)
        return Events(pixels, pixels, np.empty(0, np.int64), np.empty(0, np.int8), sensor)

    @staticmethod
    def concatenate(parts: Sequence[Events], sensor: Sensor) -> Events:
        """One after the other; the caller answers for their order in time."""
        if not parts:
            return Events.empty(sensor)
        if len(parts) == 1:
            return parts[0]
        x, y, t, p = (np.concatenate([getattr(part, name) for part in parts]) for name in ("x", "y", "t", "p"))
        return Events(x, y, t, p, sensor)
