"""Scenes whose every moment is known: a photo that turns and drifts, alone or behind a disc that crosses it.

A film of 30 frames a second is every 40th moment of what the sensor saw (1,200 a second), in 8 bits.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from etnet.events.events import Events, Sensor
from etnet.simulation.footage import Frame
from etnet.simulation.sensor import PixelArray, SensorTraits, events_of
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.tone import Tone, light_table
from etnet.simulation.walk import Stepping
from etnet.voxel import voxel_array

MOMENTS = 40
"""Between two frames of the film."""
FRAME_US = 1e6 / 30
IDEAL = SensorTraits(0.2, 0.2, dark=0.01)


@lru_cache(maxsize=8)
def photo(name: str) -> np.ndarray:
    """Light of one of scikit-image's photos, mirrored to be wide enough, as sharp as a phone's."""
    import skimage

    grey = cv2.imread(str(Path(skimage.__file__).parent / "data" / f"{name}.png"), cv2.IMREAD_GRAYSCALE)
    assert grey is not None
    light = Tone("srgb").light(grey / 255).astype(np.float32)
    light = light if light.shape[1] >= 600 else np.concatenate([light, light[:, ::-1]], 1)
    return cv2.GaussianBlur(light, (0, 0), 0.5)


@dataclass(frozen=True)
class KnownScene:
    """`speed`: pixels the photo moves from one frame of the film to the next."""

    speed: float
    has_disc: bool = False
    size: tuple[int, int] = (240, 180)
    num_frames: int = 13
    photo: str = "coffee"

    def moments(self) -> Iterator[np.ndarray]:
        """The light at every moment."""
        for i in range((self.num_frames - 1) * MOMENTS + 1):
            yield self._light(self.speed * i / MOMENTS)

    @cached_property
    def film(self) -> list[np.ndarray]:
        """8-bit sRGB frames."""
        lights = (self._light(self.speed * i) for i in range(self.num_frames))
        return [np.rint(Tone("srgb").code(light) * 255).astype(np.uint8) for light in lights]

    @cached_property
    def true_events(self) -> list[Events]:
        """What an ideal sensor sees, a list entry for each frame but the first."""
        pixels: PixelArray | None = None
        found, crossings = [], []
        for i, light in enumerate(self.moments()):
            if pixels is None:
                pixels = PixelArray(light, 0.0, IDEAL, np.random.default_rng(0))
                continue
            crossings.append(pixels.expose(light, i * FRAME_US / MOMENTS))
            if i % MOMENTS == 0:
                found.append(events_of(crossings, Sensor(*self.size)))
                crossings = []
        return found

    def shown(self) -> Iterator[Frame]:
        """The film as light, by the table that a video's codes go through."""
        light = light_table(Tone("srgb"), 8, is_limited=False)
        for i, frame in enumerate(self.film):
            yield Frame(i * FRAME_US, light[frame])

    def simulated(self, stepping: Stepping, threads: int = 2) -> list[Events]:
        """What our simulator makes of the film."""
        with EventSimulator(IDEAL, stepping, 0, threads) as simulator:
            return [events for _, events in simulator.run(self.shown())][1:]

    def _light(self, path: float) -> np.ndarray:
        width, height = self.size
        picture = photo(self.photo)
        reach = picture.shape[1] / 2 - 0.75 * width
        turn = 0.5 * np.sin(path / 120)
        x = picture.shape[1] / 2 + reach * np.sin(path / reach)
        y = picture.shape[0] / 2 + 20 * np.sin(path / 60)
        light = _moved(picture, self.size, turn, x, y)
        if self.has_disc:
            across = 0.5 + 0.35 * np.sin(1 + 1.3 * path / (0.35 * width))
            place = width * across, height * (0.5 + 0.2 * np.cos(path / 50))
            columns, rows = np.meshgrid(np.arange(width), np.arange(height))
            alpha = np.clip(0.22 * height - np.hypot(columns - place[0], rows - place[1]) + 0.5, 0, 1)
            disc = _moved(photo("astronaut"), self.size, 0.0, 256 + width / 2 - place[0], 150 + height / 2 - place[1])
            light = light * (1 - alpha) + disc * alpha
        return np.clip(light, 0, 1).astype(np.float32)


def _moved(picture: np.ndarray, size: tuple[int, int], turn: float, x: float, y: float) -> np.ndarray:
    """The picture around (x, y), turned, at `size`."""
    width, height = size
    cos, sin = np.cos(turn), np.sin(turn)
    matrix = np.array(
        [[cos, -sin, x - cos * width / 2 + sin * height / 2], [sin, cos, y - sin * width / 2 - cos * height / 2]]
    )
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(picture, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101)


def voxel_error(found: list[Events], true: list[Events]) -> float:
    """Σ|voxels − true voxels| ÷ Σ|true voxels| over windows of one frame, five bins each."""
    pairs = [(voxel_array(a), voxel_array(b)) for a, b in zip(found, true, strict=True)]
    return sum(float(np.abs(a - b).sum()) for a, b in pairs) / sum(float(np.abs(b).sum()) for _, b in pairs)


def by_frame(events: Events, num_frames: int) -> list[Events]:
    """Cut a list of events at the film's frames."""
    edges = np.searchsorted(events.t, np.floor(np.arange(num_frames) * FRAME_US))
    edges[-1] = len(events)
    return [events[a:b] for a, b in pairwise(edges)]
