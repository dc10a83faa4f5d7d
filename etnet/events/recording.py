"""A recording: random access to the events of one file, its ground truth, and what was noticed on opening it."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Int64

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.opened_as import OpenedAs
from etnet.events.provenance import Provenance
from etnet.events.triggers import Triggers

INDEX_BLOCK = 65_536
"""Events between two stamps that `index_at` remembers."""


class Span(NamedTuple):
    """The stamps of the first and the last event, µs on the file's clock."""

    start: int
    stop: int

    @property
    def duration(self) -> int:
        """Microseconds from the first event to the last."""
        return self.stop - self.start


@dataclass(frozen=True, slots=True)
class Remark:
    """Something a reader noticed: found in the file, mended, taken for granted, or worth a look before it is trusted.

    Law 6: none is kept silent.
    """

    kind: Literal["detected", "repaired", "assumed", "advice"]
    text: str

    def __str__(self) -> str:
        return f"{self.kind}: {self.text}"


@dataclass(frozen=True, slots=True)
class GroundTruth:
    """Frames of an ordinary camera, read one at a time.

    `stamps` are µs on the events' clock, ascending. `read_frame(i)` gives values in 0 … 1.
    `read_flow(i)`, where the file has it, gives the optical flow from frame i − 1 to frame i in pixels (x, y).
    """

    stamps: Int64[np.ndarray, " n"]
    read_frame: Callable[[int], Float32[np.ndarray, "h w"]]
    read_flow: Callable[[int], Float32[np.ndarray, "2 h w"]] | None = None
    white: float = 255.0
    """The number that white was in the file: 255, or more where its pictures are finer than 8 bits."""
    read_colour: Callable[[int], Float32[np.ndarray, "h w 3"]] | None = None
    """Where the pictures have colours: blue, green, red of frame i in 0 … 1."""

    def __len__(self) -> int:
        return len(self.stamps)

    def nearest(self, t: int) -> int:
        """The index of the frame whose stamp is nearest to `t` (µs); the earlier of two equally near."""
        after = int(np.searchsorted(self.stamps, t))
        if after == 0:
            return 0
        if after == len(self.stamps):
            return after - 1
        return after if self.stamps[after] - t < t - self.stamps[after - 1] else after - 1


@dataclass(frozen=True, slots=True)
class Inertial:
    """What the camera's motion sensor measured, in its own axes: stamps in µs on the events' clock, ascending."""

    stamps: Int64[np.ndarray, " n"]
    acceleration: Float32[np.ndarray, "n 3"]
    """g."""
    rotation: Float32[np.ndarray, "n 3"]
    """Degrees a second."""

    def __len__(self) -> int:
        return len(self.stamps)


@dataclass(slots=True)
class Growth:
    """How far a file has been gone through of which a recording has only the first part. It grows in the background."""

    share: float = 0.0
    """Of the file, 0 … 1, by now."""
    is_over: bool = False
    """Nothing more will come: the file, opened again, is whole (or says what is wrong with it)."""


@runtime_checkable
class EventSource(Protocol):
    """Where a recording's events lie. `read` is a slice by index, safe from two threads, ordered in time."""

    @property
    def num_events(self) -> int:
        """How many events there are."""
        ...

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1, columns as `Events` demands them. 0 ≤ start ≤ stop ≤ num_events."""
        ...

    def close(self) -> None:
        """Give back files and memory."""
        ...


@runtime_checkable
class Bracketing(Protocol):
    """A source with an index of its stamps."""

    def bracket(self, t: int) -> tuple[int, int] | None:
        """Indices (start, stop) with start ≤ i ≤ stop for the first event i whose stamp is ≥ `t`; few events between.

        None while the index is not there yet. `t` (µs) lies within the recording's span.
        """
        ...


@dataclass(frozen=True, slots=True)
class MemorySource:
    """Events that are held in memory: decoded once, or made up by a test."""

    events: Events

    @property
    def num_events(self) -> int:
        """How many events there are."""
        return len(self.events)

    def read(self, start: int, stop: int) -> Events:
        """A view, not a copy."""
        return self.events[start:stop]

    def close(self) -> None:
        """Nothing to give back."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One opened recording. `format` is the layout in plain words ("DSEC HDF5"), `path` where it came from."""

    name: str
    format: str
    source: EventSource
    sensor: Sensor
    span: Span
    remarks: tuple[Remark, ...] = ()
    ground_truth: GroundTruth | None = None
    path: Path | None = None
    inertial: Inertial | None = None
    triggers: Triggers | None = None
    """Edges on the camera's trigger inputs."""
    opened_as: OpenedAs | None = None
    """How the file at `path` gives these events again; `None` where they lie in memory or were simulated."""
    growth: Growth | None = None
    """Set where these are not yet all events of the file."""
    latest: Callable[[], Recording] | None = field(default=None, repr=False)
    """Of a recording that is still being made: what it is by now, with all that it was at its beginning.

    It has all events before the stamp of its last frame.
    """
    provenance: Provenance | None = None
    """How it was simulated, where the file tells."""
    _blocks: OrderedDict[tuple[int, int], Int64[np.ndarray, " n"]] = field(default_factory=OrderedDict, repr=False)
    _first_stamps: dict[int, int] = field(default_factory=dict, repr=False)
    _lock: Lock = field(default_factory=Lock, repr=False)

    @property
    def num_events(self) -> int:
        """How many events the recording holds."""
        return self.source.num_events

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1 (half open)."""
        if not 0 <= start <= stop <= self.num_events:
            raise RecordingError(
                f"{self.name}: asked for events {start} … {stop}, it has {self.num_events}; "
                "take indices from a window or from `index_at`"
            )
        return self.source.read(start, stop)

    def index_at(self, t: int) -> int:
        """The index of the first event whose stamp is ≥ `t` (µs); `num_events` when there is none."""
        if t <= self.span.start:
            return 0
        if t > self.span.stop:
            return self.num_events
        start, stop = (isinstance(self.source, Bracketing) and self.source.bracket(t)) or self._bracket(t)
        return start + int(np.searchsorted(self._stamps(start, stop), t))

    def close(self) -> None:
        """Give back files and memory; the recording cannot be read afterwards."""
        self.source.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _first_stamp(self, block: int) -> int:
        if block not in self._first_stamps:
            start = block * INDEX_BLOCK
            self._first_stamps[block] = int(self.source.read(start, start + 1).t[0])
        return self._first_stamps[block]

    def _bracket(self, t: int) -> tuple[int, int]:
        low, high = 0, (self.num_events - 1) // INDEX_BLOCK
        while low < high:
            middle = (low + high + 1) // 2
            low, high = (middle, high) if self._first_stamp(middle) < t else (low, middle - 1)
        return low * INDEX_BLOCK, min((low + 1) * INDEX_BLOCK, self.num_events)

    def _stamps(self, start: int, stop: int) -> Int64[np.ndarray, " n"]:
        # Blocks may begin at one event and end at different ones: a block of a silent stretch holds no event.
        block = (start, stop)
        with self._lock:
            if block in self._blocks:
                self._blocks.move_to_end(block)
                return self._blocks[block]
        stamps = np.array(self.source.read(start, stop).t)
        with self._lock:
            self._blocks[block] = stamps
            while len(self._blocks) > 8:
                self._blocks.popitem(last=False)
        return stamps


def recording_of_events(
    events: Events, name: str = "events", remarks: Sequence[Remark] = (), ground_truth: GroundTruth | None = None
) -> Recording:
    """Wrap events in memory as a recording. They must be ordered in time."""
    if len(events) and (np.diff(events.t) < 0).any():
        first = int(np.argmax(np.diff(events.t) < 0)) + 1
        raise RecordingError(
            f"{name}: time runs back at event {first} ({events.t[first - 1]} > {events.t[first]} µs); sort them first"
        )
    span = Span(int(events.t[0]), int(events.t[-1])) if len(events) else Span(0, 0)
    return Recording(name, "memory", MemorySource(events), events.sensor, span, tuple(remarks), ground_truth)
