"""An ordinary camera's frames through the simulator: events without an event camera.

`PushedFrames` takes frames from anywhere (a page's webcam); `webcam` reads one on this machine.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import UInt8

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.simulated import SimulatedSensor
from etnet.live.source import CameraFrame, Packet, WithoutSettings
from etnet.simulation.video import VideoConfig

MOST_WAITING = 4
"""Frames that wait for the simulator at most; older ones are left out and counted."""
PATIENCE = 0.1


@runtime_checkable
class FrameSensor(Protocol):
    """What turns frames into events."""

    def expose(self, grey: UInt8[np.ndarray, "h w"], t: float) -> Events:
        """The events between the frame before and this one, stamped `t` (µs). The first frame gives none."""
        ...


class PushedFrames(WithoutSettings):
    """Frames that somebody shows to a simulated sensor. `show` may be called from any thread, and never waits."""

    format = "a webcam, simulated"

    def __init__(self, name: str, sensor: Sensor, pixels: FrameSensor) -> None:
        self.name, self.sensor = name, sensor
        self._pixels = pixels
        self._waiting: deque[tuple[float, UInt8[np.ndarray, "h w"]]] = deque()
        self._num_left_out = 0
        self._changed = threading.Condition()
        self._is_closed = False

    def show(self, grey: UInt8[np.ndarray, "h w"], t: float) -> None:
        """Show a frame, stamped `t` (µs, ascending). Of more than `MOST_WAITING` that wait the oldest is left out."""
        if grey.shape != (self.sensor.height, self.sensor.width):
            height, width = grey.shape
            raise RecordingError(f"{self.name}: a frame of {width}×{height}; wanted {self.sensor}: resize it first")
        with self._changed:
            self._waiting.append((t, grey))
            if len(self._waiting) > MOST_WAITING:
                self._waiting.popleft()
                self._num_left_out += 1
            self._changed.notify()

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """The events of one frame at a time, with the frame."""
        last = -1.0
        while not is_stopped():
            with self._changed:
                if not self._waiting:
                    self._changed.wait(PATIENCE)
                shown = self._waiting.popleft() if self._waiting else None
                num_left_out, self._num_left_out = self._num_left_out, 0
                if shown is None and self._is_closed:
                    return
            if shown is None or shown[0] <= last:
                yield Packet(Events.empty(self.sensor), num_lost=num_left_out)
                continue
            last, grey = shown
            events = self._pixels.expose(grey, last)
            yield Packet(events, int(last), (CameraFrame(int(last), grey),), num_lost=num_left_out)

    def close(self) -> None:
        """No more frames."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()


class Webcam(PushedFrames):
    """The webcam with this number, filmed by a thread of its own."""

    def __init__(self, number: int, config: VideoConfig) -> None:
        self._capture = cv2.VideoCapture(number)
        is_there, picture = self._capture.read() if self._capture.isOpened() else (False, None)
        if not is_there or picture is None:
            self._capture.release()
            raise RecordingError(
                f"webcam {number}: gives no picture; is it plugged in, and does no other program use it?"
            )
        height, width = picture.shape[:2]
        scale = min(1.0, config.longest_side / max(width, height))
        sensor = Sensor(max(8, round(width * scale)), max(8, round(height * scale)))
        super().__init__(f"webcam {number}", sensor, SimulatedSensor(config))
        self._began = time.monotonic()
        self._thread = threading.Thread(target=self._film, name=self.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Give the webcam back."""
        super().close()
        self._thread.join(2.0)
        self._capture.release()

    def _film(self) -> None:
        while not self._is_closed:
            is_there, picture = self._capture.read()
            if not is_there:
                break
            t = (time.monotonic() - self._began) * 1e6
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            size = (self.sensor.width, self.sensor.height)
            self.show(cv2.resize(grey, size, interpolation=cv2.INTER_AREA).astype(np.uint8), t)
        super().close()
