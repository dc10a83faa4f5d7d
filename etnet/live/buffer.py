"""The newest events, frames and triggers of a live source, within a time and a number of bytes.

Events are numbered from the first one that ever came. What left the buffer is an error that says so, never another
event under the old number.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from threading import Condition

import numpy as np
from jaxtyping import Float32, Int64

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth
from etnet.events.triggers import Triggers
from etnet.live.source import CameraFrame, no_triggers

BLOCK = 65_536
"""Events that are held, and leave, together."""
EVENT_BYTES = 13
"""Columns x, y, t and p of one event."""
MOST_TRIGGERS = 100_000
"""Triggers that are held at most, but for some of those that leave with the last of them."""
STAMPS = 65_536
"""Camera frames that have left of which the stamps are remembered; a few more until some go."""
TRIGGERS_TOGETHER, SECOND = 1_024, 1_000_000
"""Triggers of one second (µs) are held, and leave, together, so many at most."""


@dataclass(frozen=True, slots=True)
class Keep:
    """How much is held: the last `seconds`, and at most `num_bytes`."""

    seconds: float = 60.0
    num_bytes: int = 512 << 20

    def __post_init__(self) -> None:
        if not 1 <= self.seconds <= 86_400:
            raise RecordingError(f"{self.seconds:g} s cannot be kept; it takes 1 s to 86,400 s")
        if self.num_bytes < 4 * BLOCK * EVENT_BYTES:
            least = 4 * BLOCK * EVENT_BYTES / 1e6
            raise RecordingError(f"{self.num_bytes / 1e6:g} MB are too few to keep; it takes at least {least:.1f} MB")


class _Block:
    """Columns that fill up. Events before `length` never change, so views of them stay right."""

    def __init__(self, start: int, sensor: Sensor) -> None:
        self.start, self.length = start, 0
        self._columns = Events(
            np.empty(BLOCK, np.uint16), np.empty(BLOCK, np.uint16), np.empty(BLOCK, np.int64), np.empty(BLOCK, np.int8),
            sensor,
        )  # fmt: skip

    @property
    def stop(self) -> int:
        return self.start + self.length

    def add(self, events: Events) -> int:
        """As many of the events as there is room for; returns how many."""
        room = min(BLOCK - self.length, len(events))
        to = slice(self.length, self.length + room)
        for name in ("x", "y", "t", "p"):
            getattr(self._columns, name)[to] = getattr(events, name)[:room]
        self.length += room
        return room

    def view(self, start: int, stop: int) -> Events:
        return self._columns[start - self.start : stop - self.start]

    def stamp(self, index: int) -> int:
        return int(self._columns.t[index - self.start])


@dataclass(frozen=True, slots=True)
class Extent:
    """What has come and what is still held: event numbers, and stamps in µs (`None` before the first event)."""

    num_events: int
    first_held: int
    first_stamp: int | None
    last_stamp: int | None
    held_stamp: int | None
    until: int | None
    pinned: range = range(0)
    """Events that stay readable though they may have left: the window at which the network is."""

    @property
    def gone_before(self) -> int | None:
        """The stamp (µs) before which events have left; `None` while all are there."""
        return self.held_stamp if self.first_held else None

    def is_there(self, start: int, stop: int) -> bool:
        """Whether events start … stop − 1 can be read."""
        return start >= self.first_held or (start >= self.pinned.start and stop <= self.pinned.stop)


class LiveBuffer:
    """Holds what came last. One thread adds, any number read."""

    def __init__(self, sensor: Sensor, keep: Keep) -> None:
        self.sensor, self._keep = sensor, keep
        self.changed = Condition()
        self._blocks: deque[_Block] = deque()
        self._pinned, self._pinned_blocks = range(0), list[_Block]()
        self._num_events = 0
        self._first_stamp: int | None = None
        self._last_stamp: int | None = None
        self._until: int | None = None
        self._frames: deque[CameraFrame] = deque()
        self._num_frames, self._frame_bytes = 0, 0
        self._frame_stamps, self._num_forgotten = np.empty(256, np.int64), 0
        self._triggers: deque[Triggers] = deque()
        self._num_triggers = self._num_triggers_held = 0

    def add(self, events: Events, until: int | None, frames: tuple[CameraFrame, ...], triggers: Triggers) -> None:
        """Take one packet in, and drop what is too old or too much."""
        with self.changed:
            at = 0
            while at < len(events):
                if not self._blocks or self._blocks[-1].length == BLOCK:
                    self._blocks.append(_Block(self._num_events, self.sensor))
                taken = self._blocks[-1].add(events[at:])
                self._num_events, at = self._num_events + taken, at + taken
            if len(events):
                self._first_stamp = int(events.t[0]) if self._first_stamp is None else self._first_stamp
                self._last_stamp = int(events.t[-1])
            newest = [stamp for stamp in (self._until, until, self._last_stamp) if stamp is not None]
            self._until = max(newest, default=None)
            for frame in frames:
                self._add_frame(frame)
            if len(triggers):
                self._add_triggers(triggers)
            self._drop_old()
            self.changed.notify_all()

    def extent(self) -> Extent:
        """What is there now."""
        with self.changed:
            held = self._blocks[0] if self._blocks else None
            return Extent(
                self._num_events,
                self._num_events if held is None else held.start,
                self._first_stamp,
                self._last_stamp,
                None if held is None else held.stamp(held.start),
                self._until,
                self._pinned,
            )

    @property
    def nbytes(self) -> int:
        """Bytes of the events and frames that are held."""
        with self.changed:
            return self._nbytes()

    def pin(self, start: int, stop: int) -> None:
        """Keep events start … stop − 1 readable until the next call: they may leave while the network gets to them."""
        with self.changed:
            self._pinned = range(start, stop)
            self._pinned_blocks = [block for block in self._blocks if block.start < stop and start < block.stop]

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1, which must still be there."""
        with self.changed:
            is_pinned = start >= self._pinned.start and stop <= self._pinned.stop
            blocks = self._pinned_blocks if is_pinned else list(self._blocks)
        if start == stop:
            return Events.empty(self.sensor)
        if not blocks or start < blocks[0].start:
            raise RecordingError(f"events {start} … {stop} are gone: {self._said_gone()}")
        first = (start - blocks[0].start) // BLOCK
        last = (stop - 1 - blocks[0].start) // BLOCK
        parts = [b.view(max(start, b.start), min(stop, b.start + BLOCK)) for b in blocks[first : last + 1]]
        return Events.concatenate(parts, self.sensor)

    def bracket(self, t: int, num_events: int) -> tuple[int, int]:
        """Numbers (start, stop) between which the first event stamped `t` or later lies, among the first `num_events`.

        An error where that cannot be told any more.
        """
        with self.changed:
            blocks = list(self._blocks)
        starts = [block.stamp(block.start) for block in blocks]
        place = bisect_right(starts, t - 1) - 1
        if place < 0:
            if blocks and blocks[0].start == 0:
                return 0, min(1, num_events)
            raise RecordingError(f"the moment {t / 1e6:.3f} s is gone: {self._said_gone()}")
        return blocks[place].start, min(blocks[place].start + BLOCK, num_events)

    def truth(self) -> GroundTruth | None:
        """The camera's frames so far; `None` before the first.

        Of many thousands that have left the first ones are forgotten, and those after them move up: of two truths the
        numbers of frames differ then, never a frame that is read with its own truth's number.
        """
        with self.changed:
            forgotten = self._num_forgotten
            stamps: Int64[np.ndarray, " n"] = self._frame_stamps[: self._num_frames - forgotten]
            until = self._until
        # A growing recording has all events before its last frame.
        num_settled = 0 if until is None else int(np.searchsorted(stamps, until, "right"))
        return GroundTruth(stamps[:num_settled], partial(self._read_frame, forgotten)) if num_settled else None

    def frames_from(self, first: int) -> tuple[int, tuple[CameraFrame, ...]]:
        """The frames that are held from number `first` on, with the number of the first of them."""
        with self.changed:
            start = self._num_frames - len(self._frames)
            return max(first, start), tuple(self._frames)[max(first - start, 0) :]

    def triggers_from(self, first: int) -> tuple[int, Triggers]:
        """The triggers that are held from number `first` on, with the number of the first of them."""
        with self.changed:
            held, num = tuple(self._triggers), self._num_triggers
        if not held:
            return num, no_triggers()
        joined = _joined(held)
        start = num - len(joined)
        skip = max(first - start, 0)
        return start + skip, Triggers(joined.stamps[skip:], joined.channels[skip:], joined.edges[skip:])

    def _read_frame(self, forgotten: int, index: int) -> Float32[np.ndarray, "h w"]:
        with self.changed:
            place = forgotten + index - (self._num_frames - len(self._frames))
            if 0 <= place < len(self._frames):
                return self._frames[place].pixels.astype(np.float32) / 255
        raise RecordingError(f"camera frame {index} is gone: {self._said_gone()}")

    def _add_frame(self, frame: CameraFrame) -> None:
        place = self._num_frames - self._num_forgotten
        if place == len(self._frame_stamps):
            self._make_room_for_stamps()
            place = self._num_frames - self._num_forgotten
        before = self._frame_stamps[place - 1] if place else frame.stamp
        self._frame_stamps[place] = max(frame.stamp, int(before))
        self._num_frames += 1
        self._frames.append(frame)
        self._frame_bytes += frame.pixels.nbytes

    def _make_room_for_stamps(self) -> None:
        """Columns that were handed out stay as they are."""
        stamps = self._frame_stamps
        num_gone = len(stamps) - len(self._frames)
        num_dropped = num_gone - STAMPS if num_gone - STAMPS >= len(stamps) // 4 else 0
        more = np.empty(num_dropped or len(stamps), np.int64)
        self._frame_stamps = np.concatenate([stamps[num_dropped:], more])
        self._num_forgotten += num_dropped

    def _add_triggers(self, triggers: Triggers) -> None:
        """Few long columns: all that is held is joined for each picture of a page."""
        self._num_triggers += len(triggers)
        last = self._triggers[-1] if self._triggers else None
        if last is not None and len(last) < TRIGGERS_TOGETHER and triggers.stamps[-1] - last.stamps[0] < SECOND:
            self._triggers[-1] = _joined([last, triggers])
        else:
            self._triggers.append(triggers)
        self._num_triggers_held += len(triggers)

    def _drop_old(self) -> None:
        if self._until is None:
            return
        oldest = self._until - round(self._keep.seconds * 1e6)
        while len(self._blocks) > 1 and self._blocks[0].stamp(self._blocks[0].stop - 1) < oldest:
            self._blocks.popleft()
        while self._frames and self._frames[0].stamp < oldest:
            self._drop_frame()
        while self._triggers and (
            self._triggers[0].stamps[-1] < oldest
            or (self._num_triggers_held > MOST_TRIGGERS and len(self._triggers) > 1)
        ):
            self._num_triggers_held -= len(self._triggers.popleft())
        while self._nbytes() > self._keep.num_bytes and (len(self._blocks) > 1 or self._frames):
            if len(self._blocks) > 1 and not (
                self._frames and self._frames[0].stamp < self._blocks[0].stamp(self._blocks[0].start)
            ):
                self._blocks.popleft()
            else:
                self._drop_frame()

    def _drop_frame(self) -> None:
        self._frame_bytes -= self._frames.popleft().pixels.nbytes

    def _nbytes(self) -> int:
        return len(self._blocks) * BLOCK * EVENT_BYTES + self._frame_bytes

    def _said_gone(self) -> str:
        extent = self.extent()
        if extent.gone_before is None or extent.first_stamp is None:
            return "nothing is held"
        return f"what came before {(extent.gone_before - extent.first_stamp) / 1e6:.1f} s has left the buffer"


def _joined(parts: Sequence[Triggers]) -> Triggers:
    stamps, channels, edges = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("stamps", "channels", "edges")
    )
    return Triggers(stamps, channels, edges)
