"""Windows: which events make one frame. A window is a pair of indices; planning copies no event."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import overload

from etnet.errors import WindowError
from etnet.events.recording import Recording


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


@dataclass(frozen=True, slots=True)
class BetweenFrames:
    """One window from each ground-truth frame to the next: n frames give n − 1 windows."""


@dataclass(frozen=True, slots=True)
class ByCount:
    """A fixed number of events a window."""

    num_events: int

    def __post_init__(self) -> None:
        if self.num_events < 1:
            raise WindowError(f"ByCount: got {self.num_events} events a window; it takes at least 1")


@dataclass(frozen=True, slots=True)
class ByDuration:
    """A fixed time a window, µs. `stride` (µs, the duration by default) below the duration overlaps them."""

    duration: int
    stride: int | None = None

    def __post_init__(self) -> None:
        if self.duration < 1 or self.step < 1:
            raise WindowError(
                f"ByDuration: got duration {self.duration} and stride {self.stride} µs; both are at least 1 µs"
            )

    @property
    def step(self) -> int:
        """Microseconds from one window's start to the next one's."""
        return self.duration if self.stride is None else self.stride


@dataclass(frozen=True, slots=True)
class ByDensity:
    """A fixed number of events per pixel of the sensor: `ByCount(round(r · width · height))`."""

    events_per_pixel: float

    def __post_init__(self) -> None:
        if not (self.events_per_pixel > 0 and math.isfinite(self.events_per_pixel)):
            raise WindowError(f"ByDensity: got {self.events_per_pixel} events per pixel; it takes a number above 0")


Policy = BetweenFrames | ByCount | ByDuration | ByDensity


def plan_windows(recording: Recording, policy: Policy) -> Sequence[Window]:
    """The recording's windows under `policy`, computed when asked for: planning hours of events costs nothing."""
    if recording.num_events == 0:
        return ()
    match policy:
        case BetweenFrames():
            return _plan_between_frames(recording)
        case ByCount(num_events):
            return _CountPlan(recording, num_events)
        case ByDensity(events_per_pixel):
            return _CountPlan(recording, max(1, round(events_per_pixel * recording.sensor.num_pixels)))
        case ByDuration():
            return _DurationPlan(recording, policy.duration, policy.step)


def _plan_between_frames(recording: Recording) -> Sequence[Window]:
    truth = recording.ground_truth
    if truth is None or len(truth) < 2:
        raise WindowError(
            f"{recording.name}: BetweenFrames needs at least two frames, it has {len(truth) if truth else 0}; "
            "use ByDuration(20_000) or ByDensity(0.35)"
        )
    edges = [recording.index_at(int(t)) for t in truth.stamps]
    stamps = [int(t) for t in truth.stamps]
    return tuple(Window(i, edges[i], edges[i + 1], stamps[i], stamps[i + 1]) for i in range(len(stamps) - 1))


def from_window(windows: Sequence[Window], first: int) -> Sequence[Window]:
    """The windows from `first` on, numbered anew from 0: what a network sees that wakes up there."""
    if first == 0:
        return windows
    if not 0 < first < len(windows):
        raise WindowError(f"window {first} of {len(windows)}: cannot start there; take one that exists")
    return _LaterPlan(windows, first)


def grown_windows(recording: Recording, policy: Policy, until: int, former: Sequence[Window] = ()) -> Sequence[Window]:
    """The windows of a recording that is still being made which nothing can change any more.

    All events before `until` (µs) are there. `former`: this plan when the recording was shorter.
    """
    if isinstance(policy, BetweenFrames) and former:
        truth = recording.ground_truth
        assert truth is not None
        stamps = [int(t) for t in truth.stamps[len(former) :]]
        edges = [former[-1].stop, *(recording.index_at(t) for t in stamps[1:])]
        more = (
            Window(len(former) + i, edges[i], edges[i + 1], stamps[i], stamps[i + 1]) for i in range(len(stamps) - 1)
        )
        return (*former, *more)
    windows = plan_windows(recording, policy)
    length = len(windows)
    waits = isinstance(policy, ByDuration)
    while length and ((last := windows[length - 1]).is_partial or (waits and last.t_stop > until)):
        length -= 1
    return windows if length == len(windows) else _EarlierPlan(windows, length)


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


class _CountPlan(_Plan):
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


class _DurationPlan(_Plan):
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


class _LaterPlan(_Plan):
    def __init__(self, windows: Sequence[Window], first: int) -> None:
        super().__init__(len(windows) - first)
        self._windows = windows
        self._first = first

    def _window(self, index: int) -> Window:
        return replace(self._windows[self._first + index], index=index)


class _EarlierPlan(_Plan):
    def __init__(self, windows: Sequence[Window], length: int) -> None:
        super().__init__(length)
        self._windows = windows

    def _window(self, index: int) -> Window:
        return self._windows[index]
