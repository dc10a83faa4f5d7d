"""One photo or panorama that a camera moves over, as footage: every moment of it is known exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float64, Shaped

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.simulation.arrays import light_of
from etnet.simulation.footage import Frame, Framing
from etnet.simulation.picture_file import assumed_tone, colour_of, read_picture
from etnet.simulation.tone import Tone

Motion = Literal["saccades", "drift"]
FRAMES_PER_SECOND = 1_000
"""Moments that are rendered a second at least; more where the path is fast, so that nothing jumps a pixel."""

MOST_MOMENTS = 1_000_000
"""That a fast path may take; a long one has its 1,000 a second."""

_SHORTEST = 1e-6
"""Seconds: what lies closer together, as where a part begins next to a row of the table, has no speed of its own."""

STORED_PER_SECOND = 50
"""Moments that are stored as an ordinary camera's frames."""


class PhotoInMotion:
    """A sensor that looks at a part of a photo and moves. x and y are pixels of the sensor, from the photo's middle.

    "saccades" are three strokes along a triangle, 100 ms each, as the recordings of N-MNIST and N-Caltech101 were made
    (Orchard et al. 2015, §3.2); "drift" wanders smoothly; a CSV has rows of seconds, x, y and, if it has them, degrees
    and zoom.
    """

    is_fine = True

    def __init__(
        self,
        photo: Path,
        motion: Motion | Path = "saccades",
        framing: Framing | None = None,
        seconds: float = 0.3,
        reach: float = 10.0,
        seed: int = 0,
        tone: Tone | None = None,
        has_colour: bool = False,
    ) -> None:
        """`tone` None: light itself where values are floats, else sRGB; which of the two is told."""
        self.name, self.remarks, framing = photo.name, list[str](), framing or Framing()
        if not photo.is_file():
            raise RecordingError(f"{photo.name}: there is no such picture")
        picture = read_picture(photo)
        self.tone = tone or assumed_tone(picture, self.remarks)
        self.bits = 8 if picture.dtype == np.uint8 else 16
        left, top, wide, high = framing.cropped(picture.shape[1], picture.shape[0], self.name)
        turned = np.rot90(picture[top : top + high, left : left + wide], -(framing.rotate // 90))
        picture = np.ascontiguousarray(turned)
        light = light_of(picture, self.tone, self.name)
        self._path = _part(_path(motion, seconds, reach, seed), framing, self.name)
        self._path[:, 0] /= framing.speed
        margin = 0.0 if isinstance(motion, Path) else 2 * reach
        self.sensor, scale = _fit(light, framing, margin, self.name)
        self._light, self._colour = _shrunk(light, scale), None
        if has_colour and picture.ndim == 2:
            self.remarks.append("the photo is grey: there is no colour to store")
        elif has_colour:
            self._colour = _shrunk(colour_of(picture), scale)
        self.duration = float(self._path[-1, 0] - self._path[0, 0])
        self._num_frames = _num_steps(self._path, self.sensor, motion.name if isinstance(motion, Path) else motion) + 1
        self.interval = self.duration * 1e6 / (self._num_frames - 1)

    def __iter__(self) -> Iterator[Frame]:
        start, stride = self._path[0, 0], max(1, round(1e6 / STORED_PER_SECOND / self.interval))
        for i, t in enumerate(np.linspace(0, self.duration, self._num_frames)):
            x, y, degrees, zoom = (float(np.interp(start + t, self._path[:, 0], self._path[:, i])) for i in range(1, 5))
            matrix = self._placed(x, y, math.radians(degrees), zoom)
            is_stored = i % stride == 0 or i == self._num_frames - 1
            colour = self._view(self._colour, matrix) if self._colour is not None and is_stored else None
            yield Frame(t * 1e6, self._view(self._light, matrix), colour, is_stored=is_stored)

    def close(self) -> None:
        """Nothing to give back."""

    def _placed(self, x: float, y: float, turn: float, zoom: float) -> Float64[np.ndarray, "2 3"]:
        """From the sensor's pixels to the photo's."""
        width, height = self.sensor.width, self.sensor.height
        cos, sin = math.cos(turn) / zoom, math.sin(turn) / zoom
        u, v = (width - 1) / 2, (height - 1) / 2
        centre_x, centre_y = (self._light.shape[1] - 1) / 2 + x, (self._light.shape[0] - 1) / 2 + y
        return np.array([[cos, -sin, centre_x - cos * u + sin * v], [sin, cos, centre_y - sin * u - cos * v]])

    def _view(self, picture: Shaped[np.ndarray, "_ _ *c"], matrix: Float64[np.ndarray, "2 3"]) -> np.ndarray:
        size, flags = (self.sensor.width, self.sensor.height), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(picture, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101)


def _num_steps(path: Float64[np.ndarray, "n 5"], sensor: Sensor, name: str) -> int:
    """Even steps in which the path is gone: so many that its fastest stretch moves by half a pixel a step at most.

    Raises RecordingError where that would be absurdly many.
    """
    seconds, shift = np.diff(path[:, 0]), np.hypot(*np.diff(path[:, 1:3], axis=0).T)
    turn, zoom = np.abs(np.diff(np.radians(path[:, 3]))), np.stack([path[:-1, 4], path[1:, 4]])
    side = max(sensor.width, sensor.height) / 2
    # x and y are the sensor's pixels at a zoom of 1, which a larger one stretches; a change of zoom counts as a share.
    way = shift * zoom.max(0) + (turn + np.abs(zoom[1] - zoom[0]) / zoom.min(0)) * side
    speed = way / np.maximum(seconds, _SHORTEST)
    duration = float(path[-1, 0] - path[0, 0])
    plain, wanted = max(2, math.ceil(duration * FRAMES_PER_SECOND)), math.ceil(2 * duration * float(speed.max()))
    if wanted > max(plain, MOST_MOMENTS):
        worst = int(speed.argmax())
        raise RecordingError(
            f"{name}: moves by {way[worst]:.0f} pixels in {seconds[worst]:.3g} s, from {path[worst, 0]:.3g} s on; "
            f"half a pixel a moment takes {wanted:,} moments over its {duration:.3g} s, and at most {MOST_MOMENTS:,} "
            "are rendered: give that stretch more time, or simulate a part of it (--from, --to)"
        )
    return max(plain, wanted)


def _shrunk(picture: Shaped[np.ndarray, "_ _ *c"], scale: float) -> np.ndarray:
    if scale <= 1:
        return picture
    size = max(1, round(picture.shape[1] / scale)), max(1, round(picture.shape[0] / scale))
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _fit(light: np.ndarray, framing: Framing, margin: float, name: str) -> tuple[Sensor, float]:
    """The sensor, and by how much the photo shrinks so that the sensor sees all of it but a margin for the motion."""
    height, width = light.shape
    if framing.size is not None:
        sensor = Sensor(*framing.size)
        scale = min(width / (sensor.width + margin), height / (sensor.height + margin))
        if scale < 1:
            raise RecordingError(f"{name}: is {width}×{height}, too small for a sensor of {sensor} that moves over it")
        return sensor, scale
    scale = max(1.0, max(width, height) / (framing.longest_side + margin))
    return Sensor(max(8, int(width / scale - margin)), max(8, int(height / scale - margin))), scale


def _part(path: Float64[np.ndarray, "n 5"], framing: Framing, name: str) -> Float64[np.ndarray, "m 5"]:
    """The path from `start` to `stop`, in seconds since its beginning."""
    seconds = path[:, 0] - path[0, 0]
    start, stop = framing.start, seconds[-1] if framing.stop is None else min(framing.stop, seconds[-1])
    if start >= stop:
        raise RecordingError(f"{name}: its motion takes {seconds[-1]:g} s; nothing of it is left from {start:g} s on")
    t = np.concatenate([[start], seconds[(seconds > start) & (seconds < stop)], [stop]])
    return np.stack([t, *(np.interp(t, seconds, path[:, i]) for i in range(1, 5))], 1)


def _path(motion: Motion | Path, seconds: float, reach: float, seed: int) -> Float64[np.ndarray, "n 5"]:
    """Rows of seconds, x, y, degrees, zoom."""
    if isinstance(motion, Path):
        return _read_path(motion)
    if seconds <= 0 or reach <= 0:
        raise RecordingError(f"the motion takes {seconds:g} s and reaches {reach:g} pixels; wanted numbers above 0")
    if motion == "saccades":
        corners = np.array([[0.0, -0.5], [0.5, 0.5], [-0.5, 0.5], [0.0, -0.5]]) * reach
        num_strokes = max(1, round(seconds / 0.1))
        x, y = corners[np.arange(num_strokes + 1) % 3].T
        t = np.linspace(0, seconds, num_strokes + 1)
    else:
        rng, t = np.random.default_rng(seed), np.linspace(0, seconds, max(3, math.ceil(seconds * 100)) + 1)
        rates, phases = rng.uniform(0.2, 1.2, (2, 3, 1)), rng.uniform(0, 2 * np.pi, (2, 3, 1))
        x, y = (np.sin(2 * np.pi * rates * t + phases).mean(1) - np.sin(phases).mean(1)) * reach
    return np.stack([t, x, y, np.zeros_like(t), np.ones_like(t)], 1)


def _read_path(table: Path) -> Float64[np.ndarray, "n 5"]:
    rows = []
    for number, line in enumerate(table.read_text().splitlines(), start=1):
        cells = [cell.strip() for cell in line.split(",")]
        try:
            values = [float(cell) for cell in cells]
        except ValueError:
            if number == 1 or line.lstrip().startswith("#") or not line.strip():
                continue
            raise RecordingError(
                f"{table.name}: line {number} is {line!r}; wanted seconds, x, y[, degrees[, zoom]]"
            ) from None
        if not 3 <= len(values) <= 5:
            raise RecordingError(f"{table.name}: line {number} has {len(values)} numbers; wanted 3 to 5")
        rows.append([*values, *(0.0, 1.0)[len(values) - 3 :]])
    path = np.array(rows, np.float64).reshape(-1, 5)
    if len(path) < 2 or not np.isfinite(path).all() or (np.diff(path[:, 0]) <= 0).any() or (path[:, 4] <= 0).any():
        raise RecordingError(
            f"{table.name}: wanted at least two rows of finite numbers, ascending seconds, a zoom above 0"
        )
    return path
