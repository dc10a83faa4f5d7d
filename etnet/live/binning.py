"""A growing recording as the network sees it: 2×2 or 4×4 pixels joined to one. No event is lost."""

from __future__ import annotations

from dataclasses import replace
from threading import Lock
from typing import Literal

from etnet.events.events import Sensor
from etnet.events.opened_as import View
from etnet.events.recording import Recording
from etnet.events.view import seen_whole

Downsample = Literal[1, 2, 4]
"""Pixels a side that become one."""
LARGEST = Sensor(346, 260)
"""Sensors above this size are binned for the network unless asked otherwise."""


class Binned:
    """`latest()` is the binned recording as it is by now; the same object while nothing was added."""

    def __init__(self, recording: Recording, downsample: Downsample) -> None:
        self._view = View(downsample=downsample)
        self._lock = Lock()
        self._of = recording
        self._seen = self._through(recording)

    def latest(self) -> Recording:
        """What there is by now."""
        with self._lock:
            newest = self._of.latest() if self._of.latest is not None else self._of
            if newest is not self._of:
                self._of, self._seen = newest, self._through(newest)
            return self._seen

    def _through(self, recording: Recording) -> Recording:
        seen = seen_whole(self._view, recording)
        return replace(seen, latest=None if recording.latest is None else self.latest)


def binned(recording: Recording, downsample: Downsample) -> Recording:
    """The recording with its pixels joined; itself where there is nothing to join."""
    return recording if downsample == 1 else Binned(recording, downsample).latest()


def fitting_downsample(sensor: Sensor) -> Downsample:
    """How many pixels a side become one, so that the network sees at most 346×260 of them (4 at most)."""
    factors: tuple[Downsample, ...] = (1, 2)
    for factor in factors:
        if -(-sensor.width // factor) <= LARGEST.width and -(-sensor.height // factor) <= LARGEST.height:
            return factor
    return 4
