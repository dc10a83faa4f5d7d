"""What a simulated sensor looks at: frames of light with their moments, from wherever they come."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.simulation.tone import Tone


@dataclass(frozen=True, eq=False, slots=True)
class Frame:
    """Light (linear, 1 is white) at a moment (µs from the first frame). `is_cut`: a scene begins, says the source."""

    t: float
    light: Float32[np.ndarray, "h w"]
    colour: UInt8[np.ndarray, "h w 3"] | None = None
    is_cut: bool = False
    is_stored: bool = True
    """Whether it becomes a frame of the recording; footage of very many frames stores some of them."""


@runtime_checkable
class Footage(Protocol):
    """Frames in order of time, one in memory. What was found, mended or assumed is told while they are read."""

    name: str
    sensor: Sensor
    tone: Tone
    bits: int
    remarks: list[str]
    is_fine: bool
    """Whether nothing moves a pixel between two frames, so that no motion has to be looked for."""

    @property
    def duration(self) -> float:
        """Seconds before the sensor, as far as it is known before all frames are read."""
        ...

    @property
    def interval(self) -> float:
        """Mean µs between two frames, as far as it is known."""
        ...

    def __iter__(self) -> Iterator[Frame]:
        """From the first frame to the last, once."""
        ...

    def close(self) -> None:
        """Give back the file."""
        ...


@dataclass(frozen=True, slots=True)
class Framing:
    """Which part of each picture falls on the sensor, and when. Crop is (left, top, width, height) in pixels of the
    upright picture; `rotate` turns clockwise in quarter turns after that; start and stop are seconds of the source."""

    longest_side: int = 320
    size: tuple[int, int] | None = None
    """Width and height of the sensor; the picture is cut to its shape. None keeps the picture's shape."""
    crop: tuple[int, int, int, int] | None = None
    rotate: int = 0
    start: float = 0.0
    stop: float | None = None
    speed: float = 1.0

    def __post_init__(self) -> None:
        if not 16 <= self.longest_side <= 1280:
            raise RecordingError(f"the longest side is {self.longest_side}; it takes 16 to 1280 pixels")
        if self.size is not None and not all(8 <= side <= 2048 for side in self.size):
            raise RecordingError(f"the sensor is {self.size[0]}×{self.size[1]}; it takes 8 to 2048 pixels a side")
        if not 0.001 <= self.speed <= 1000:
            raise RecordingError(f"speed is {self.speed:g}; it takes 0.001 to 1000")
        if self.rotate % 90:
            raise RecordingError(f"rotate is {self.rotate}; it takes 0, 90, 180 or 270 degrees")
        if self.start < 0 or (self.stop is not None and self.stop <= self.start):
            until = "the end" if self.stop is None else f"{self.stop:g} s"
            raise RecordingError(f"the part is {self.start:g} s … {until}; wanted two ascending times from 0 on")

    def cropped(self, width: int, height: int, name: str) -> tuple[int, int, int, int]:
        """The part of an upright picture that was asked for: left, top, width, height."""
        left, top, wide, high = self.crop or (0, 0, width, height)
        if not (0 <= left < left + wide <= width and 0 <= top < top + high <= height):
            raise RecordingError(f"{name}: its pictures are {width}×{height}; a crop of {self.crop} leaves them")
        return left, top, wide, high

    def box(self, width: int, height: int, name: str) -> tuple[int, int, int, int]:
        """The part of it that falls on the sensor: what was asked for, cut to the sensor's shape."""
        left, top, wide, high = self.cropped(width, height, name)
        if self.size is not None:
            across, down = self.size if self.rotate % 180 == 0 else self.size[::-1]
            fit = min(wide / across, high / down)
            inner = max(1, round(across * fit)), max(1, round(down * fit))
            left, top = left + (wide - inner[0]) // 2, top + (high - inner[1]) // 2
            wide, high = inner
        if min(wide, high) < 8:
            raise RecordingError(f"{name}: its pictures are {wide}×{high}; wanted at least 8 pixels a side")
        return left, top, wide, high

    def sensor(self, width: int, height: int, name: str) -> Sensor:
        """The sensor's size for pictures of this size."""
        _, _, wide, high = self.box(width, height, name)
        if self.rotate % 180:
            wide, high = high, wide
        if self.size is not None:
            return Sensor(*self.size)
        scale = min(1.0, self.longest_side / max(wide, high))
        return Sensor(max(8, round(wide * scale)), max(8, round(high * scale)))

    def applied(self, picture: np.ndarray, sensor: Sensor, name: str) -> np.ndarray:
        """The part of an upright picture, at the sensor's size. Light is averaged as light."""
        left, top, wide, high = self.box(picture.shape[1], picture.shape[0], name)
        picture = picture[top : top + high, left : left + wide]
        if self.rotate % 360:
            picture = np.rot90(picture, -(self.rotate // 90))
        if picture.shape[:2] != (sensor.height, sensor.width):
            size = (sensor.width, sensor.height)
            is_smaller = picture.shape[1] >= sensor.width
            picture = cv2.resize(
                np.ascontiguousarray(picture), size, interpolation=cv2.INTER_AREA if is_smaller else cv2.INTER_LINEAR
            )
        return np.ascontiguousarray(picture)
