"""Windows: which events make one frame. A window is a pair of indices; planning copies no event."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from etnet.errors import WindowError
from etnet.events.recording import Recording
from etnet.window_plans import (
    CountPlan,
    DurationPlan,
    EarlierPlan,
    LaterPlan,
    Window,
    plan_by_activity,
    plan_by_either,
)

__all__ = [
    "BetweenFrames",
    "ByActivity",
    "ByCount",
    "ByCountOrDuration",
    "ByDensity",
    "ByDuration",
    "ByStamps",
    "Policy",
    "Window",
    "from_window",
    "grown_windows",
    "plan_windows",
    "settled_until",
]


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


@dataclass(frozen=True, slots=True)
class ByStamps:
    """One window that ends at each of the given moments (µs on the recording's clock, ascending).

    It reaches back by `duration` (µs) or by `num_events`; with neither, to the moment before, and the first one to the
    recording's beginning.
    """

    stamps: tuple[int, ...] = field(repr=False)
    duration: int | None = None
    num_events: int | None = None

    def __post_init__(self) -> None:
        # A session file's list becomes what can be hashed.
        object.__setattr__(self, "stamps", tuple(int(stamp) for stamp in self.stamps))
        if not self.stamps:
            raise WindowError("ByStamps: got no stamps; give at least one moment in µs")
        if any(later <= earlier for earlier, later in itertools.pairwise(self.stamps)):
            raise WindowError("ByStamps: the stamps are not ascending; sort them and leave out repeats")
        if self.duration is not None and self.num_events is not None:
            raise WindowError("ByStamps: got a duration and a number of events; give one of the two, or neither")
        if (self.duration or 1) < 1 or (self.num_events or 1) < 1 or 0 in (self.duration, self.num_events):
            raise WindowError(
                f"ByStamps: got duration {self.duration} µs and {self.num_events} events; each is at least 1"
            )


@dataclass(frozen=True, slots=True)
class ByCountOrDuration:
    """Windows that end after `num_events` events or `duration` µs, whichever comes first."""

    num_events: int
    duration: int

    def __post_init__(self) -> None:
        if self.num_events < 1 or self.duration < 1:
            raise WindowError(
                f"ByCountOrDuration: got {self.num_events} events and {self.duration} µs; each is at least 1"
            )


@dataclass(frozen=True, slots=True)
class ByActivity:
    """Adaptive windows: one ends when this share of the sensor's pixels has had an event since its beginning."""

    active_pixels: float

    def __post_init__(self) -> None:
        if not 0 < self.active_pixels <= 1:
            raise WindowError(f"ByActivity: got {self.active_pixels}; it takes a share of the pixels, above 0 up to 1")


Policy = BetweenFrames | ByCount | ByDuration | ByDensity | ByStamps | ByCountOrDuration | ByActivity


def plan_windows(recording: Recording, policy: Policy, former: Sequence[Window] | None = None) -> Sequence[Window]:
    """The recording's windows under `policy`, computed when asked for: planning hours of events costs nothing.

    Of a recording that is not whole yet (`latest` or `growth` is set) the windows that more events can change are left
    out. `former` is this plan when the recording was shorter: its windows are taken over where that saves work.
    """
    if recording.num_events == 0:
        return ()
    windows = _planned(recording, policy, former or ())
    if recording.latest is not None:
        return _settled(windows, settled_until(recording))
    if recording.growth is not None:
        # The first part of a file that is being indexed is worth a look even if it fills no window.
        return _settled(windows, recording.span.stop) or windows
    return windows


def settled_until(recording: Recording) -> int:
    """The moment (µs) before which no event will be added to a recording that is still being made.

    It is the stamp of its last event or of its last frame, the later of the two: who makes a recording shows a frame
    only when all events before it are there.
    """
    truth = recording.ground_truth
    last_frame = int(truth.stamps[-1]) if truth is not None and len(truth) else recording.span.stop
    return max(last_frame, recording.span.stop)


def _planned(recording: Recording, policy: Policy, former: Sequence[Window]) -> Sequence[Window]:
    match policy:
        case BetweenFrames():
            return _plan_between_frames(recording, former)
        case ByCount(num_events):
            return CountPlan(recording, num_events)
        case ByDensity(events_per_pixel):
            return CountPlan(recording, max(1, round(events_per_pixel * recording.sensor.num_pixels)))
        case ByDuration():
            return DurationPlan(recording, policy.duration, policy.step)
        case ByStamps():
            return _plan_by_stamps(recording, policy)
        case ByCountOrDuration(num_events, duration):
            return plan_by_either(recording, num_events, duration, former)
        case ByActivity(active_pixels):
            return plan_by_activity(recording, active_pixels, former)


def _plan_between_frames(recording: Recording, former: Sequence[Window]) -> Sequence[Window]:
    truth = recording.ground_truth
    if truth is None or len(truth) < 2:
        raise WindowError(
            f"{recording.name}: BetweenFrames needs at least two frames, it has {len(truth) if truth else 0}; "
            "use ByDuration(20_000) or ByDensity(0.35)"
        )
    stamps = [int(t) for t in truth.stamps[len(former) :]]
    first = former[-1].stop if former else recording.index_at(stamps[0])
    edges = [first, *(recording.index_at(t) for t in stamps[1:])]
    count = len(former)
    more = (Window(count + i, edges[i], edges[i + 1], stamps[i], stamps[i + 1]) for i in range(len(stamps) - 1))
    return (*former, *more)


def _plan_by_stamps(recording: Recording, policy: ByStamps) -> Sequence[Window]:
    span, stamps = recording.span, policy.stamps
    if recording.latest is None and (stamps[-1] < span.start or stamps[0] > span.stop + 1):
        raise WindowError(
            f"{recording.name}: its events span {span.start} … {span.stop} µs, the stamps {stamps[0]} … {stamps[-1]}; "
            "they must be on the recording's own clock, in µs"
        )
    windows: list[Window] = []
    stop, former = 0, min(span.start, stamps[0])
    for index, stamp in enumerate(stamps):
        start, stop = stop, recording.index_at(stamp)
        t_start = former
        if policy.duration is not None:
            t_start = stamp - policy.duration
            start = recording.index_at(t_start)
        elif policy.num_events is not None:
            start = max(0, stop - policy.num_events)
            t_start = int(recording.read(start, start + 1).t[0]) if start < stop else stamp
        windows.append(Window(index, start, stop, t_start, stamp))
        former = stamp
    return tuple(windows)


def from_window(windows: Sequence[Window], first: int) -> Sequence[Window]:
    """The windows from `first` on, numbered from 0: what a network sees that starts there."""
    if first == 0:
        return windows
    if not 0 < first < len(windows):
        raise WindowError(f"window {first} of {len(windows)}: cannot start there; take one that exists")
    return LaterPlan(windows, first)


def grown_windows(recording: Recording, policy: Policy, until: int, former: Sequence[Window] = ()) -> Sequence[Window]:
    """The windows of a recording that is still being made which more events cannot change.

    All events before `until` (µs) are there. `former`: this plan when the recording was shorter. `plan_windows` does
    the same where the recording itself says that it grows.
    """
    return _settled(_planned(recording, policy, former), until)


def _settled(windows: Sequence[Window], until: int) -> Sequence[Window]:
    """Without the last windows that are partial or end after `until`."""
    length = len(windows)
    while length and (windows[length - 1].is_partial or windows[length - 1].t_stop > until):
        length -= 1
    return windows if length == len(windows) else EarlierPlan(windows, length)
