"""The clock of a live source, made to run one way. What was done to it is said."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from etnet.events.events import Events
from etnet.events.triggers import Triggers
from etnet.live.source import Packet

SMALL_STEP = 10_000
"""µs that stamps may run back before it counts as another clock: packets that overtake each other."""
LARGE_STEP = 3_600_000_000
"""µs that stamps may run ahead from one packet to the next before it counts as another clock."""
RESUME_GAP = 1_000
"""µs from the last event before a clock began again to the first one after it."""


@dataclass(frozen=True, slots=True)
class Mended:
    """A packet whose stamps do not run back, and what it took."""

    packet: Packet
    num_held_up: int
    """Events that got the stamp of an earlier event, because they came after it with a lower one."""


class OneWayClock:
    """Shifts stamps when a source's clock begins again, and holds up the few that overtake each other."""

    def __init__(self) -> None:
        self._last: int | None = None
        self._shift = 0

    def mended(self, packet: Packet) -> Mended:
        """The packet on a clock that runs one way. Another clock is told in its notes."""
        notes = packet.notes
        if len(packet.events):
            first = int(packet.events.t[0]) + self._shift
            if self._last is not None and not self._last - SMALL_STEP <= first <= self._last + LARGE_STEP:
                step = (first - self._last) / 1e6
                said = f"went back by {-step:.3f} s" if step < 0 else f"jumped ahead by {step:.0f} s"
                self._shift += self._last + RESUME_GAP - first
                notes = (*notes, f"the clock {said}; stamps go on from where it was")
        events, num_held_up = self._ordered(packet.events)
        until = None if packet.until is None else packet.until + self._shift
        if until is not None and self._last is not None:
            until = max(until, self._last)
        frames = tuple(replace(frame, stamp=frame.stamp + self._shift) for frame in packet.frames)
        return Mended(
            replace(packet, events=events, until=until, frames=frames, triggers=self._edges(packet), notes=notes),
            num_held_up,
        )

    def _ordered(self, events: Events) -> tuple[Events, int]:
        if len(events) == 0:
            return events, 0
        t = events.t + self._shift if self._shift else events.t
        lowest = t[0] if self._last is None else max(int(t[0]), self._last)
        num_held_up = 0
        if t[0] < lowest or (t[1:] < t[:-1]).any():
            straight = np.maximum(np.maximum.accumulate(t), lowest)
            num_held_up = int(np.count_nonzero(straight != t))
            t = straight
        self._last = int(t[-1])
        return (events if t is events.t else Events(events.x, events.y, t, events.p, events.sensor)), num_held_up

    def _edges(self, packet: Packet) -> Triggers:
        if self._shift == 0 or len(packet.triggers) == 0:
            return packet.triggers
        return replace(packet.triggers, stamps=packet.triggers.stamps + self._shift)
