"""One photo or panorama that a camera moves over, as footage: every moment of it is known exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float64

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.simulation.arrays import light_of
from etnet.simulation.footage import Frame, Framing
from etnet.simulation.picture_folder import read_picture
from etnet.simulation.tone import Tone

Motion = Literal["saccades", "drift"]
FRAMES_PER_SECOND = 1_000
"""Moments that are rendered a second at least; more where the path is fast, so that nothing jumps a pixel."""

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
    ) -> None:
        self.name, self.remarks, self.tone, framing = photo.name, list[str](), Tone("srgb"), framing or Framing()
        if not photo.is_file():
            raise RecordingError(f"{photo.name}: there is no such picture")
        picture = read_picture(photo)
        self.bits = 8 if picture.dtype == np.uint8 else 16
        light = light_of(picture, self.tone)
        left, top, wide, high = framing.crop or (0, 0, light.shape[1], light.shape[0])
        light = np.ascontiguousarray(np.rot90(light[top : top + high, left : left + wide], -(framing.rotate // 90)))
        self._path = _path(motion, seconds, reach, seed)
        self._path[:, 0] /= framing.speed
        margin = 0.0 if isinstance(motion, Path) else 2 * reach
        self.sensor, self._scale = _fit(light, framing, margin, self.name)
        smaller = (max(1, round(light.shape[1] / self._scale)), max(1, round(light.shape[0] / self._scale)))
        self._light = cv2.resize(light, smaller, interpolation=cv2.INTER_AREA) if self._scale > 1 else light
        self.duration = float(self._path[-1, 0] - self._path[0, 0])
        way = float(np.hypot(*np.diff(self._path[:, 1:3], axis=0).T).sum())
        side = max(self.sensor.width, self.sensor.height) / 2
        way += (
            float(np.abs(np.diff(np.radians(self._path[:, 3]))).sum() + np.abs(np.diff(self._path[:, 4])).sum()) * side
        )
        self._num_frames = max(2, math.ceil(self.duration * FRAMES_PER_SECOND), math.ceil(2 * way)) + 1
        self.interval = self.duration * 1e6 / (self._num_frames - 1)

    def __iter__(self) -> Iterator[Frame]:
        start, stride = self._path[0, 0], max(1, round(1e6 / STORED_PER_SECOND / self.interval))
        for i, t in enumerate(np.linspace(0, self.duration, self._num_frames)):
            x, y, degrees, zoom = (float(np.interp(start + t, self._path[:, 0], self._path[:, i])) for i in range(1, 5))
            light = self._view(x, y, math.radians(degrees), zoom)
            yield Frame(t * 1e6, light, is_stored=i % stride == 0 or i == self._num_frames - 1)

    def close(self) -> None:
        """Nothing to give back."""

    def _view(self, x: float, y: float, turn: float, zoom: float) -> np.ndarray:
        width, height = self.sensor.width, self.sensor.height
        cos, sin = math.cos(turn) / zoom, math.sin(turn) / zoom
        u, v = (width - 1) / 2, (height - 1) / 2
        centre_x, centre_y = (self._light.shape[1] - 1) / 2 + x, (self._light.shape[0] - 1) / 2 + y
        matrix = np.array([[cos, -sin, centre_x - cos * u + sin * v], [sin, cos, centre_y - sin * u - cos * v]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpAffine(self._light, matrix, (width, height), flags=flags, borderMode=cv2.BORDER_REFLECT_101)


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
    if len(path) < 2 or (np.diff(path[:, 0]) <= 0).any() or (path[:, 4] <= 0).any():
        raise RecordingError(f"{table.name}: wanted at least two rows, ascending seconds, and a zoom above 0")
    return path
