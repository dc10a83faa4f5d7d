"""A recording that plays at its own speed as if a camera sent it: for tests, for shows, and for want of a camera."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording
from etnet.events.triggers import Triggers
from etnet.live.source import CameraFrame, Packet, WithoutSettings, no_triggers

LOOP_GAP = 1_000
"""µs between the last event of one round and the first of the next."""
MARGIN = 1_000_000
"""µs before the first and after the last event in which frames are replayed too."""
LARGEST_PACKET = 1 << 20
"""Events handed over at once, where the replay is late."""
AHEAD = 1 << 16
"""Events that are read at once of a slow recording, for many packets."""


@dataclass(frozen=True, eq=False)
class Replay(WithoutSettings):
    """`speed` times real time; 0 is as fast as the packets are taken. A packet holds `packet_us` of the recording."""

    recording: Recording
    speed: float = 1.0
    is_looped: bool = False
    packet_us: int = 5_000

    def __post_init__(self) -> None:
        if not 0 <= self.speed <= 1_000:
            raise RecordingError(f"replay: a speed of {self.speed:g}; it takes 0 (as fast as it goes) to 1,000")
        if self.packet_us < 100:
            raise RecordingError(f"replay: packets of {self.packet_us} µs; they take at least 100 µs")
        if self.recording.num_events == 0:
            raise RecordingError(f"{self.recording.name}: holds no events; there is nothing to replay")

    @property
    def name(self) -> str:
        """The recording's."""
        return self.recording.name

    @property
    def format(self) -> str:
        """The recording's, and that it is replayed."""
        return f"{self.recording.format}, replayed"

    @property
    def sensor(self) -> Sensor:
        """The recording's."""
        return self.recording.sensor

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """Round after round. Each goes on after the one before it on one clock."""
        first, end = self._extent()
        reader = _Ahead(self.recording)
        shift, began, played = 0, time.monotonic(), 0
        while True:
            start, at, before = 0, first, first - 1
            while start < self.recording.num_events or at <= end:
                at += self.packet_us
                self._wait(played + at - first, began, is_stopped)
                if is_stopped():
                    return
                stop = reader.stop_at(start, at)
                for place in range(start, max(stop, start + 1), LARGEST_PACKET):
                    last = min(place + LARGEST_PACKET, stop)
                    is_whole = last == stop
                    yield Packet(
                        _shifted(reader.read(place, last), shift),
                        at + shift if is_whole else None,
                        self._frames(before, at, shift) if is_whole else (),
                        self._triggers(before, at, shift) if is_whole else no_triggers(),
                    )
                start, before = stop, at - 1
            if not self.is_looped:
                return
            length = end - first + LOOP_GAP
            played, shift = played + length, shift + length

    def close(self) -> None:
        """Close the recording."""
        self.recording.close()

    def _extent(self) -> tuple[int, int]:
        """From the first to the last event, and to frames a little before and after them."""
        span, truth = self.recording.span, self.recording.ground_truth
        if truth is None or len(truth) == 0:
            return span.start, span.stop
        first, last = int(truth.stamps[0]), int(truth.stamps[-1])
        return max(min(span.start, first), span.start - MARGIN), min(max(span.stop, last), span.stop + MARGIN)

    def _wait(self, played: int, began: float, is_stopped: Callable[[], bool]) -> None:
        """Until so many µs of recordings are due."""
        while self.speed and not is_stopped():
            wait = played / (1e6 * self.speed) - (time.monotonic() - began)
            if wait <= 0:
                return
            time.sleep(min(wait, 0.1))

    def _frames(self, after: int, before: int, shift: int) -> tuple[CameraFrame, ...]:
        """The camera's frames with after < stamp < before."""
        truth = self.recording.ground_truth
        if truth is None:
            return ()
        first, last = np.searchsorted(truth.stamps, [after + 1, before])
        return tuple(
            CameraFrame(
                int(truth.stamps[i]) + shift, np.rint(np.clip(truth.read_frame(i), 0, 1) * 255).astype(np.uint8)
            )
            for i in range(int(first), int(last))
        )

    def _triggers(self, after: int, before: int, shift: int) -> Triggers:
        triggers = self.recording.triggers
        if triggers is None or len(triggers) == 0:
            return no_triggers()
        first, last = np.searchsorted(triggers.stamps, [after + 1, before])
        part = slice(int(first), int(last))
        return Triggers(triggers.stamps[part] + shift, triggers.channels[part], triggers.edges[part])


def _shifted(events: Events, shift: int) -> Events:
    return events if shift == 0 else Events(events.x, events.y, events.t + shift, events.p, events.sensor)


class _Ahead:
    """A recording's events in long stretches: a file that is unpacked for each packet costs more than the packet."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._start = recording, 0
        self._events = Events.empty(recording.sensor)

    def stop_at(self, start: int, t: int) -> int:
        """The number of the first event stamped `t` (µs) or later, where all before `start` are earlier."""
        if not self._start <= start < self._stop:
            self._start = start
            self._events = self._recording.read(start, min(start + AHEAD, self._recording.num_events))
        if self._stop < self._recording.num_events and self._events.t[-1] < t:
            return self._recording.index_at(t)
        return self._start + int(np.searchsorted(self._events.t, t))

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1."""
        if self._start <= start and stop <= self._stop:
            return self._events[start - self._start : stop - self._start]
        return self._recording.read(start, stop)

    @property
    def _stop(self) -> int:
        return self._start + len(self._events)
