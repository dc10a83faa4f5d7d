"""The simulator's pixels as a live source wants them: one grey frame after the other, events out."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from etnet.events.events import Events, Sensor
from etnet.simulation.sensor import PixelArray, draw_noise, events_of
from etnet.simulation.video import VideoConfig

GAMMA = 2.2
"""Of a camera's grey values; the sensor sees light."""


class SimulatedSensor:
    """The simulator's pixels, shown one frame after the other."""

    def __init__(self, sensor: Sensor, config: VideoConfig) -> None:
        self._sensor, self._config = sensor, config
        self._rng = np.random.default_rng(config.seed)
        self._pixels: PixelArray | None = None
        self._before = 0.0

    def expose(self, grey: UInt8[np.ndarray, "h w"], t: float) -> Events:
        """The events between the frame before and this one."""
        light = (grey.astype(np.float32) / 255) ** np.float32(GAMMA)
        traits, before = self._config.traits, self._before
        self._before = t
        if self._pixels is None:
            self._pixels = PixelArray(light, t, traits, self._rng)
            return Events.empty(self._sensor)
        noise = draw_noise(light, (before, t), traits, self._rng)
        return events_of([self._pixels.expose(light, t), noise], self._sensor)
