"""The windows of a live recording, cut as the network gets to them and kept as they were cut.

When a step was late, the windows that wait are merged into one that holds all their events: nothing is skipped and
nothing queues up. A recorded file and the kept windows give the live frames again, to the bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import overload

import numpy as np
from jaxtyping import Int64

from etnet.errors import WindowError
from etnet.events.events import Sensor
from etnet.live.buffer import Extent
from etnet.live.recording import LiveRecording
from etnet.windows import ByCount, ByDensity, ByDuration, Policy, Window

GONE = 65_536
"""Windows whose events have left the buffer of which it is remembered when they were; a few more until some go."""


class KeptWindows(Sequence[Window]):
    """Windows that were cut, as rows of numbers: start, stop, t_start, t_stop, how many were merged into it.

    They keep their numbers for good. Long after their events have left the buffer windows are forgotten: such a window
    holds no events and lies where the first one that is known begins. One thread appends, any number read.
    """

    def __init__(self) -> None:
        rows: Int64[np.ndarray, "n 5"] = np.empty((256, 5), np.int64)
        self._known = 0, rows
        """The number of the first window that is not forgotten, and the rows from it on: changed together."""
        self._length = 0

    def append(self, window: Window, num_merged: int, first_held: int = 0) -> None:
        """Keep one more. `first_held`: the number of the first event that the buffer still holds."""
        first, rows = self._known
        if self._length - first == len(rows):
            first, rows = self._known = self._with_room(first, rows, first_held)
        rows[self._length - first] = window.start, window.stop, window.t_start, window.t_stop, num_merged
        self._length += 1

    def __len__(self) -> int:
        return self._length

    @property
    def first_known(self) -> int:
        """The number of the first window that is not forgotten."""
        return self._known[0]

    @property
    def nbytes(self) -> int:
        """Bytes of what is remembered."""
        return self._known[1].nbytes

    def num_merged(self, index: int) -> int:
        """How many windows of the policy this one holds; 1 where the step was in time, 0 where it is forgotten."""
        first, rows = self._known
        return int(rows[index - first, 4]) if index >= first else 0

    @overload
    def __getitem__(self, index: int) -> Window: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Window]: ...
    def __getitem__(self, index: int | slice) -> Window | Sequence[Window]:
        length = self._length  # before the rows, which hold at least so many
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(length))]
        if not -length <= index < length:
            raise IndexError(f"window {index} of {length}")
        index %= length
        first, rows = self._known
        if index < first:
            began = int(rows[0, 2])
            return Window(index, 0, 0, began, began)
        start, stop, t_start, t_stop, _ = (int(value) for value in rows[index - first])
        return Window(index, start, stop, t_start, t_stop)

    def _with_room(
        self, first: int, rows: Int64[np.ndarray, "n 5"], first_held: int
    ) -> tuple[int, Int64[np.ndarray, "m 5"]]:
        """The rows without those of windows that left long ago, where these are many; else twice as long."""
        num_forgotten = int(np.searchsorted(rows[:, 0], first_held)) - GONE
        if num_forgotten < len(rows) // 4:
            return first, np.concatenate([rows, np.empty_like(rows)])
        kept = rows[num_forgotten:]
        return first + num_forgotten, np.concatenate([kept, np.empty((num_forgotten, 5), np.int64)])


class LiveWindows:
    """Cuts the windows of `live` under `policy` when they are asked for. Used by one thread; `kept` is read by any."""

    def __init__(self, live: LiveRecording, policy: Policy, sensor: Sensor | None = None) -> None:
        """`sensor` is what the network sees, where the live one's pixels are binned: density counts its pixels."""
        if isinstance(policy, ByDuration) and policy.stride not in (None, policy.duration):
            raise WindowError(f"live windows do not overlap; got a stride of {policy.step} µs: leave it out")
        if not isinstance(policy, ByCount | ByDensity | ByDuration):
            raise WindowError(
                f"live windows go by count, density or duration; {type(policy).__name__} is for recordings"
            )
        self.live, self.policy = live, policy
        self._sensor = sensor or live.sensor
        self.kept = KeptWindows()
        self.num_merged = 0
        """Windows that were merged into a later one because a step was late."""
        self.num_unseen = 0
        """Events that had left the buffer before the network got to them."""
        self._start: int | None = None
        self._t_start = 0

    def begin_now(self) -> None:
        """The first window begins with the next event, and not with what came before."""
        extent = self.live.extent()
        if extent.until is not None:
            self._start, self._t_start = extent.num_events, extent.until

    def take(self, timeout: float = 0.5, is_stopped: Callable[[], bool] = lambda: False) -> Window | None:
        """The next window, with all that has come for it by now; `None` if none was full within `timeout` seconds.

        Its events can be read until the next one is taken, though they may have left the buffer by then.
        """
        until = time.monotonic() + timeout
        changed = self.live.buffer.changed
        with changed:
            while (cut := self._cut(self.live.extent())) is None:
                left = until - time.monotonic()
                if left <= 0 or self.live.is_over or is_stopped():
                    return None
                changed.wait(min(left, 0.1))
            # Under one lock: a window as long as the buffer would begin to leave at once.
            self.live.buffer.pin(cut[0].start, cut[0].stop)
        window, num_windows = cut
        self.kept.append(window, num_windows, self.live.extent().first_held)
        self.num_merged += num_windows - 1
        self._start, self._t_start = window.stop, window.t_stop
        return window

    def is_full(self) -> bool:
        """Whether a whole window waits to be taken. Any thread may ask."""
        extent = self.live.extent()
        if extent.first_stamp is None or extent.until is None:
            return False
        start, t_start = self._start, self._t_start
        if start is None:
            start, t_start = extent.first_held, extent.held_stamp or extent.first_stamp
        if isinstance(self.policy, ByDuration):
            return extent.until - t_start >= self.policy.duration
        return extent.num_events - max(start, extent.first_held) >= _num_events(self.policy, self._sensor)

    def _cut(self, extent: Extent) -> tuple[Window, int] | None:
        """All whole windows that wait, as one, and how many they are."""
        if extent.first_stamp is None or extent.until is None:
            return None
        if self._start is None:
            self._start, self._t_start = extent.first_held, extent.held_stamp or extent.first_stamp
        if self._start < extent.first_held:
            self.num_unseen += extent.first_held - self._start
            self._start = extent.first_held
            if extent.held_stamp is not None:
                self._t_start = max(self._t_start, extent.held_stamp)
        if isinstance(self.policy, ByDuration):
            return self._cut_by_duration(self.policy.duration, extent)
        return self._cut_by_count(_num_events(self.policy, self._sensor), extent)

    def _cut_by_count(self, num_events: int, extent: Extent) -> tuple[Window, int] | None:
        assert self._start is not None
        num_windows = (extent.num_events - self._start) // num_events
        if num_windows == 0:
            return None
        stop = self._start + num_windows * num_events
        buffer = self.live.buffer
        first, last = buffer.read(self._start, self._start + 1).t[0], buffer.read(stop - 1, stop).t[0]
        return Window(len(self.kept), self._start, stop, int(first), int(last)), num_windows

    def _cut_by_duration(self, duration: int, extent: Extent) -> tuple[Window, int] | None:
        assert self._start is not None
        assert extent.until is not None
        num_windows = (extent.until - self._t_start) // duration
        if num_windows == 0:
            return None
        t_stop = self._t_start + num_windows * duration
        if extent.last_stamp is None or t_stop > extent.last_stamp:
            stop = extent.num_events
        else:
            low, high = self.live.buffer.bracket(t_stop, extent.num_events)
            low = max(low, self._start)
            stop = low + int(np.searchsorted(self.live.buffer.read(low, high).t, t_stop)) if low < high else low
        return Window(len(self.kept), self._start, max(stop, self._start), self._t_start, t_stop), num_windows


def _num_events(policy: Policy, sensor: Sensor) -> int:
    match policy:
        case ByCount(num_events):
            return num_events
        case ByDensity(events_per_pixel):
            return max(1, round(events_per_pixel * sensor.num_pixels))
    raise WindowError(f"{policy} is not cut by count")
