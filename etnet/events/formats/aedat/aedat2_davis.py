"""What a DAVIS writes between its events in AEDAT 2.0: words with bit 31 set, pixels of its pictures and of its motion.

Layout (docs.inivation.com, "AEDAT 2.0"; jAER's DavisBaseCamera and IMUSample): y bits 30–22, x 21–12, then bits 11–10
tell a reset read (0), a signal read (1) or motion (3), and bits 9–0 hold the converter's value. Motion: bits 30–28 the
axis, 27–12 a value of 16 bits with sign.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float32, Int64

from etnet.events.cache import FrameCache, grey
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks
from etnet.events.formats.camera_frames import in_order
from etnet.events.formats.imu import InertialTable
from etnet.events.recording import GroundTruth

_RESET, _SIGNAL, _MOTION = 0, 1, 3
_AXES = 7
"""Acceleration x y z, temperature, rotation x y z: words of one sample, in this order."""

_PER_G, _PER_DEGREE = 8192, 65.5
"""Steps a g and steps a degree per second at jAER's usual ranges, ±4 g and ±500 °/s."""


def first_pixel(address: Int64[np.ndarray, " n"], t: Int64[np.ndarray, " n"], sensor: Sensor) -> int | None:
    """Where the chip's readout begins: the pixel that most often follows the longest waits. None without pictures."""
    is_signal = (address >> 31 == 1) & (address >> 10 & 3 == _SIGNAL)
    place, stamps = _place(address[is_signal], sensor), t[is_signal]
    if len(place) == 0:
        return None
    num_frames = max(1, len(place) // sensor.num_pixels)
    waits = np.diff(stamps, prepend=stamps[0])
    after = np.argsort(-waits, kind="stable")[:num_frames] if waits.any() else np.array([0])
    values, counts = np.unique(place[after], return_counts=True)
    return int(values[np.argmax(counts)])


def _place(address: Int64[np.ndarray, " n"], sensor: Sensor) -> Int64[np.ndarray, " n"]:
    """Row-major pixel, the first row on top; −1 beyond the sensor."""
    x, y = address >> 12 & 0x3FF, address >> 22 & 0x1FF
    inside = (x < sensor.width) & (y < sensor.height)
    return np.where(inside, (sensor.height - 1 - y) * sensor.width + x, -1)


@dataclass
class Samples:
    """Pictures and motion as they gather. A picture is what each pixel's signal read is below its last reset read."""

    sensor: Sensor
    first: int | None
    frames: FrameCache
    stamps: list[int] = field(default_factory=list)
    motion: InertialTable = field(default_factory=InertialTable)
    num_broken: int = 0
    num_outside: int = 0

    def __post_init__(self) -> None:
        num = self.sensor.num_pixels
        self._reset_at, self._signal_at = np.full(num, -1, np.int64), np.full(num, -1, np.int64)
        self._reset, self._signal = np.zeros(num, np.int16), np.zeros(num, np.int16)
        self._is_open = False
        self._motion = np.empty((0, 2), np.int64)

    def take(self, address: Int64[np.ndarray, " n"], t: Int64[np.ndarray, " n"]) -> None:
        """The next words with bit 31 set, in the file's order."""
        kind = address >> 10 & 3
        self._take_motion(address[kind == _MOTION], t[kind == _MOTION])
        is_read = (kind == _RESET) | (kind == _SIGNAL)
        place, kind, value, t = (
            _place(address[is_read], self.sensor),
            kind[is_read],
            address[is_read] & 0x3FF,
            t[is_read],
        )
        inside = place >= 0
        self.num_outside += int(len(place) - np.count_nonzero(inside))
        place, kind, value, t = place[inside], kind[inside], value[inside], t[inside]
        begins = np.flatnonzero((kind == _SIGNAL) & (place == self.first))
        bounds = [0, *begins.tolist(), len(place)]
        for i, (start, stop) in enumerate(pairwise(bounds)):
            if i > 0:
                self._begin()
            self._take_reads(place[start:stop], kind[start:stop] == _SIGNAL, value[start:stop], t[start:stop])

    def truth(self, remarks: Remarks) -> GroundTruth | None:
        """The whole pictures, and what there is to say of the others."""
        self.num_broken += self._is_open
        if self.num_broken:
            remarks.repaired(f"{self.num_broken} pictures that were not read out whole were left out")
        if self.num_outside:
            remarks.repaired(f"{self.num_outside} picture samples beyond the sensor were left out")
        if not self.stamps:
            return None
        remarks.assumed("a picture is reset read minus signal read, its stamp the mean middle of its pixels' exposures")

        def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
            return grey(self.frames[index])

        stamps = np.array(self.stamps, np.int64)
        return in_order(stamps, GroundTruth(stamps, read_frame), remarks)

    def _begin(self) -> None:
        self.num_broken += self._is_open
        self._is_open = True
        self._signal_at[:] = -1

    def _take_reads(
        self, place: Int64[np.ndarray, " n"], is_signal: np.ndarray, value: Int64[np.ndarray, " n"], t: np.ndarray
    ) -> None:
        """Reads of one picture; resets after its last signal belong to the next one."""
        signals = np.flatnonzero(is_signal)
        end = int(signals[-1]) + 1 if len(signals) else 0
        early, late = ~is_signal, ~is_signal
        early[end:], late[:end] = False, False
        self._reset[place[early]], self._reset_at[place[early]] = value[early], t[early]
        if self._is_open:
            self._signal[place[is_signal]], self._signal_at[place[is_signal]] = value[is_signal], t[is_signal]
            if len(signals) and bool((self._signal_at >= 0).all()):
                self._finish()
        self._reset[place[late]], self._reset_at[place[late]] = value[late], t[late]

    def _finish(self) -> None:
        self._is_open = False
        if bool((self._reset_at < 0).any()):
            self.num_broken += 1
            return
        bits = np.clip(self._reset - self._signal, 0, 1023).astype(np.uint16)
        # Ten bits fill sixteen: white stays white.
        self.frames.append((bits << 6 | bits >> 4).reshape(self.sensor.height, self.sensor.width))
        self.stamps.append(int(np.rint(np.mean((self._reset_at + self._signal_at) / 2))))

    def _take_motion(self, address: Int64[np.ndarray, " n"], t: Int64[np.ndarray, " n"]) -> None:
        words = np.concatenate([self._motion, np.stack([address, t], 1)])
        axis = words[:, 0] >> 28 & 7
        starts = np.flatnonzero(axis[: max(0, len(axis) - _AXES + 1)] == 0)
        rows = starts[:, None] + np.arange(_AXES)
        whole = rows[(axis[rows] == np.arange(_AXES)).all(1)]
        after = int(whole[-1, -1]) + 1 if len(whole) else 0
        self._motion = words[max(after, len(words) - _AXES + 1) :]
        values = (words[whole, 0] >> 12 & 0xFFFF).astype(np.uint16).view(np.int16).astype(np.float32)
        self.motion.add(words[whole[:, 0], 1], values[:, :3] / _PER_G, values[:, 4:] / np.float32(_PER_DEGREE))
