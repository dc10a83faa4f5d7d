"""The simulator as a live source wants it: one grey frame after the other, events out."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from etnet.events.events import Events
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.video import VideoConfig
from etnet.simulation.walk import Stepping

GAMMA = 2.2
"""Of a camera's grey values; the sensor sees light."""
MOST_STEPS = 8
"""Between two frames: what comes live must not take longer than the frames do. What moves farther is stepped over."""


class SimulatedSensor:
    """A modelled sensor that follows the motion between frames, as it does for videos; in the caller's thread alone."""

    def __init__(self, config: VideoConfig) -> None:
        stepping = Stepping(most_steps=MOST_STEPS, finds_cuts=False)
        self._simulator = EventSimulator(config.traits, stepping, config.seed, threads=1)

    def expose(self, grey: UInt8[np.ndarray, "h w"], t: float) -> Events:
        """The events between the frame before and this one, stamped `t` (µs); none at the first."""
        return self._simulator.feed((grey.astype(np.float32) / 255) ** np.float32(GAMMA), t)

    def close(self) -> None:
        """Give back what the simulator holds."""
        self._simulator.close()
