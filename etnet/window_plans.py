"""Sequences of windows: each window is made from its index when it is asked for."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import overload

import numpy as np
from jaxtyping import Int64

from etnet.errors import WindowError
from etnet.events.recording import Recording

MOST_WINDOWS = 10_000_000
"""Of a plan that has to be made whole: an hour of windows of 360 µs."""

_SHORTEST_LOOK = 1 << 12
_BLOCK = 1 << 18
"""Events looked at in one go where pixels have to be counted."""


@dataclass(frozen=True, slots=True)
class Window:
    """Events start … stop − 1 (half open), stamps t_start … t_stop (µs). The frame's stamp is `t_stop`.

    `is_partial` marks a last window that its policy could not fill.
    """

    index: int
    start: int
    stop: int
    t_start: int
    t_stop: int
    is_partial: bool = False

    @property
    def num_events(self) -> int:
        """How many events the window holds; 0 is allowed."""
        return self.stop - self.start


class _Plan(Sequence[Window]):
    """Windows made on demand from their index."""

    def __init__(self, length: int) -> None:
        self._length = length

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> Window: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Window]: ...
    def __getitem__(self, index: int | slice) -> Window | Sequence[Window]:
        if isinstance(index, slice):
            return [self._window(i) for i in range(*index.indices(self._length))]
        if not -self._length <= index < self._length:
            raise IndexError(f"window {index} of {self._length}")
        return self._window(index % self._length)

    def _window(self, index: int) -> Window:
        raise NotImplementedError


class CountPlan(_Plan):
    """A fixed number of events a window."""

    def __init__(self, recording: Recording, num_events: int) -> None:
        super().__init__(math.ceil(recording.num_events / num_events))
        self._recording = recording
        self._num_events = num_events

    def _window(self, index: int) -> Window:
        start = index * self._num_events
        stop = min(start + self._num_events, self._recording.num_events)
        first = self._recording.read(start, start + 1).t[0]
        last = self._recording.read(stop - 1, stop).t[0]
        return Window(index, start, stop, int(first), int(last), stop - start < self._num_events)


class DurationPlan(_Plan):
    """A fixed time a window, one every `step` µs."""

    def __init__(self, recording: Recording, duration: int, step: int) -> None:
        # The last event lies inside the last window: half open windows need one microsecond past it.
        super().__init__(recording.span.duration // step + 1)
        self._recording = recording
        self._duration = duration
        self._step = step

    def _window(self, index: int) -> Window:
        t_start = self._recording.span.start + index * self._step
        t_stop = t_start + self._duration
        start, stop = self._recording.index_at(t_start), self._recording.index_at(t_stop)
        return Window(index, start, stop, t_start, t_stop, t_stop > self._recording.span.stop + 1)


class EdgePlan(_Plan):
    """Windows that follow each other without a gap: window i lies between edge i and edge i + 1."""

    def __init__(self, events: Int64[np.ndarray, " n"], stamps: Int64[np.ndarray, " n"], is_last_partial: bool) -> None:
        super().__init__(len(events) - 1)
        self._events = events
        self._stamps = stamps
        self._is_last_partial = is_last_partial

    def _window(self, index: int) -> Window:
        start, stop = int(self._events[index]), int(self._events[index + 1])
        is_partial = self._is_last_partial and index == len(self) - 1
        return Window(index, start, stop, int(self._stamps[index]), int(self._stamps[index + 1]), is_partial)


class LaterPlan(_Plan):
    """The windows from `first` on, numbered from 0."""

    def __init__(self, windows: Sequence[Window], first: int) -> None:
        super().__init__(len(windows) - first)
        self._windows = windows
        self._first = first

    def _window(self, index: int) -> Window:
        return replace(self._windows[self._first + index], index=index)


class EarlierPlan(_Plan):
    """The first `length` windows."""

    def __init__(self, windows: Sequence[Window], length: int) -> None:
        super().__init__(length)
        self._windows = windows

    def _window(self, index: int) -> Window:
        return self._windows[index]


def plan_by_either(
    recording: Recording, num_events: int, duration: int, former: Sequence[Window] = ()
) -> Sequence[Window]:
    """Each window ends with its last event of `num_events`, or after `duration` µs if that comes first."""
    events, stamps = _edges(former, recording)
    start, t_start = events[-1], stamps[-1]
    total, is_partial = recording.num_events, False
    while start < total:
        last = min(start + num_events, total) - 1
        t_last = int(recording.read(last, last + 1).t[0])
        is_full = last - start + 1 == num_events
        if is_full and t_last < t_start + duration:
            start, t_start = last + 1, t_last
        elif t_last >= t_start + duration:
            t_start += duration
            start = recording.index_at(t_start)
        else:
            start, t_start, is_partial = total, t_last, True
        events.append(start)
        stamps.append(t_start)
        _check_number(events, recording)
    return EdgePlan(np.array(events, np.int64), np.array(stamps, np.int64), is_partial)


def plan_by_activity(recording: Recording, share: float, former: Sequence[Window] = ()) -> Sequence[Window]:
    """Each window ends with the event by which `share` of all pixels have had one since its beginning."""
    events, stamps = _edges(former, recording)
    wanted = max(1, math.ceil(share * recording.sensor.num_pixels))
    look, num_active = max(4 * wanted, _SHORTEST_LOOK), 0
    for first, before, t in _revisits(recording, events[-1]):
        place = 0
        while place < len(t):
            # An event is its pixel's first of the window where the pixel's last event came before the window.
            counts = num_active + np.cumsum(before[place : place + look] < events[-1])
            reached = int(np.searchsorted(counts, wanted))
            if reached == len(counts):
                num_active, place = int(counts[-1]), place + len(counts)
                continue
            num_active, place = 0, place + reached + 1
            events.append(first + place)
            stamps.append(int(t[place - 1]))
            _check_number(events, recording)
    is_partial = events[-1] < recording.num_events
    if is_partial:
        events.append(recording.num_events)
        stamps.append(recording.span.stop)
    return EdgePlan(np.array(events, np.int64), np.array(stamps, np.int64), is_partial)


def _check_number(events: list[int], recording: Recording) -> None:
    if len(events) > MOST_WINDOWS:
        raise WindowError(f"{recording.name}: more than {MOST_WINDOWS:,} windows; make each of them larger")


def _edges(former: Sequence[Window], recording: Recording) -> tuple[list[int], list[int]]:
    """The edges of the windows so far: event indices and stamps."""
    begin = former[0] if former else None
    events = [begin.start if begin else 0, *(window.stop for window in former)]
    return events, [begin.t_start if begin else recording.span.start, *(window.t_stop for window in former)]


def _revisits(
    recording: Recording, start: int
) -> Iterator[tuple[int, Int64[np.ndarray, " n"], Int64[np.ndarray, " n"]]]:
    """Blocks from event `start` on: the first event, each event's predecessor at its pixel (−1: none), the stamps."""
    width = recording.sensor.width
    last = np.full(recording.sensor.num_pixels, -1, np.int64)
    for first in range(start, recording.num_events, _BLOCK):
        events = recording.read(first, min(first + _BLOCK, recording.num_events))
        pixel = events.y.astype(np.int64) * width + events.x
        order = np.argsort(pixel, kind="stable")
        before = np.empty(len(pixel), np.int64)
        before[order[1:]] = first + order[:-1]
        is_first = np.diff(pixel[order], prepend=-1) != 0
        before[order[is_first]] = last[pixel[order[is_first]]]
        ends = np.append(np.flatnonzero(is_first)[1:] - 1, len(order) - 1)
        last[pixel[order[ends]]] = first + order[ends]
        yield first, before, events.t
