"""The layouts in which events come over a stream, decoded as their bytes arrive.

Event Stream 2.0 (github.com/neuromorphicsystems/event_stream), and the two layouts that faery sends over UDP. What is
left of an event at the end of a piece waits for the next piece, so a decoder holds a few bytes at most.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor

LayoutName = Literal["t64_x16_y16_on8", "t32_x16_y15_on1", "es"]

EVENT_STREAM_HEAD = 20
"""Bytes before the first event of an Event Stream of the kind "dvs"."""
LONGEST_SILENCE = 3_600_000_000
"""µs that stamps may jump forward; more than that are wrong bytes."""

_T64 = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "u1")])
_T32 = np.dtype([("t", "<u4"), ("x", "<u2"), ("y_on", "<u2")])
_OVERFLOW, _RESET, _OVERFLOW_US = 0xFF, 0xFE, 127
_LOOK_AHEAD = 1024
"""Events that are looked through for the next byte that only lets time pass."""


RECORD_BYTES: dict[LayoutName, int] = {"t64_x16_y16_on8": 13, "t32_x16_y15_on1": 8}
"""Of the layouts whose events all have one size."""


class WrongBytes(RecordingError):
    """What came cannot be events of this layout and sensor."""


@runtime_checkable
class Decoder(Protocol):
    """Bytes in, events out."""

    @property
    def until(self) -> int | None:
        """The stamp (µs) up to which everything was decoded; `None` before the first."""
        ...

    def decode(self, content: bytes) -> Events:
        """The events that `content` completes. Raises WrongBytes."""
        ...


def decoder_of(layout: LayoutName, sensor: Sensor) -> Decoder:
    """A fresh decoder, which remembers nothing of another sender."""
    if layout == "es":
        return EventStreamDecoder(sensor)
    return RecordDecoder(sensor, _T64 if layout == "t64_x16_y16_on8" else _T32)


def event_stream_sensor(head: bytes) -> Sensor:
    """The sensor's size that an Event Stream's first bytes state. Raises WrongBytes for anything else."""
    if head[:12] != b"Event Stream" or len(head) < EVENT_STREAM_HEAD:
        raise WrongBytes(f'it begins with {head[:12]!r} instead of "Event Stream"')
    if head[12] != 2 or head[15] != 1:
        raise WrongBytes(f"it is Event Stream {head[12]}, type {head[15]}; wanted version 2, type 1 (dvs)")
    width, height = struct.unpack_from("<HH", head, 16)
    if not (width and height):
        raise WrongBytes(f"its header gives the sensor {width} × {height}; sides are 1 … 65,535")
    return Sensor(width, height)


@dataclass
class RecordDecoder:
    """Records of one size, in a stream or in datagrams of whole records."""

    sensor: Sensor
    record: np.dtype

    def __post_init__(self) -> None:
        self._rest = b""
        self._turns, self._last = 0, None

    @property
    def until(self) -> int | None:
        """The last event's stamp."""
        return self._last

    def decode(self, content: bytes) -> Events:
        """Whole records; the bytes of a part of one are kept."""
        content = self._rest + content
        num = len(content) // self.record.itemsize
        self._rest = content[num * self.record.itemsize :]
        rows = np.frombuffer(content, self.record, num)
        if num == 0:
            return Events.empty(self.sensor)
        if "on" in (self.record.names or ()):
            y, on, t = rows["y"], rows["on"], rows["t"]
            if on.max() > 1 or t.max() >= 2**62:
                raise WrongBytes(f"a polarity of {on.max()} or a stamp of {t.max()} µs")
            stamps = t.astype(np.int64)
        else:
            y, on = rows["y_on"] >> 1, rows["y_on"] & 1
            stamps = self._unrolled(rows["t"].astype(np.int64))
        events = Events(
            np.ascontiguousarray(rows["x"]), np.ascontiguousarray(y), stamps, (2 * on.astype(np.int8) - 1), self.sensor
        )
        _check(events, self._last)
        self._last = int(stamps[-1])
        return events

    def _unrolled(self, t: np.ndarray) -> np.ndarray:
        """32-bit stamps begin again after 2³² µs: a step back by more than half of it is a turn."""
        before = t[0] if self._last is None else self._last & 0xFFFFFFFF
        steps = np.diff(t, prepend=before)
        turns = self._turns + np.cumsum((steps < -(1 << 31)).astype(np.int64))
        self._turns = int(turns[-1])
        return t + (turns << 32)


@dataclass
class EventStreamDecoder:
    """Event Stream 2.0, type dvs, after its header. Five bytes an event, its stamp a step of up to 126 µs.

    y is counted from the bottom there.
    """

    sensor: Sensor

    def __post_init__(self) -> None:
        self._rest, self._t, self._last = b"", 0, 0

    @property
    def until(self) -> int | None:
        """The stream's time, which passes without events too."""
        return self._t

    def decode(self, content: bytes) -> Events:
        """Runs of whole events between the bytes that only let time pass."""
        data = np.frombuffer(self._rest + content, np.uint8)
        place, runs, stamps = 0, [], []
        while place < len(data):
            num = min((len(data) - place) // 5, _LOOK_AHEAD)
            if num == 0 and data[place] < _RESET:
                break
            first = data[place : place + 5 * num : 5] if num else data[place : place + 1]
            marks = first >= _RESET
            num_events = int(np.argmax(marks)) if marks.any() else num
            if num_events:
                rows = data[place : place + 5 * num_events].reshape(-1, 5)
                t = self._t + np.cumsum(rows[:, 0] >> 1, dtype=np.int64)
                runs.append(rows)
                stamps.append(t)
                self._t = int(t[-1])
                place += 5 * num_events
                self._last = self._t
            passing = data[place : place + _LOOK_AHEAD] >= _RESET
            num_passing = len(passing) if passing.all() else int(np.argmin(passing))
            overflows = data[place : place + num_passing] == _OVERFLOW
            self._t += _OVERFLOW_US * int(np.count_nonzero(overflows))
            place += num_passing
            if self._t - self._last > LONGEST_SILENCE:
                raise WrongBytes(f"{(self._t - self._last) / 1e6:.0f} s without an event")
        self._rest = data[place:].tobytes()
        if not runs:
            return Events.empty(self.sensor)
        rows, t = np.concatenate(runs), np.concatenate(stamps)
        x = rows[:, 1].astype(np.uint16) | (rows[:, 2].astype(np.uint16) << 8)
        y = rows[:, 3].astype(np.uint16) | (rows[:, 4].astype(np.uint16) << 8)
        if y.max() >= self.sensor.height:
            raise WrongBytes(f"an event at ({x[np.argmax(y)]}, {y.max()}), beyond {self.sensor}")
        p = 2 * (rows[:, 0] & 1).astype(np.int8) - 1
        events = Events(x, np.uint16(self.sensor.height - 1) - y, t, p, self.sensor)
        _check(events, None)
        return events


def _check(events: Events, last: int | None) -> None:
    if events.x.max() >= events.sensor.width or events.y.max() >= events.sensor.height:
        outside = (events.x >= events.sensor.width) | (events.y >= events.sensor.height)
        i = int(np.argmax(outside))
        raise WrongBytes(f"an event at ({events.x[i]}, {events.y[i]}), beyond {events.sensor}")
    steps = np.diff(events.t, prepend=events.t[0] if last is None else last)
    if steps.max() > LONGEST_SILENCE:
        raise WrongBytes(f"stamps that jump by {int(steps.max()) / 1e6:.0f} s")
