"""What a camera's driver says of itself: how far it got, what it dropped, how much waits in it.

The driver is neuromorphic-drivers; its status and packets are those of version 0.18.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Told:
    """What the driver says of itself with a packet."""

    until: int | None
    """All events before this stamp (µs) are there."""
    num_dropped: int | None
    """USB packets dropped since the camera was opened."""
    delay: float | None
    backlog: int

    @classmethod
    def of(cls, status: Any) -> Told:
        """Where nothing came in time there is no ring to tell of."""
        ring = status.ring
        if ring is None:
            return cls(None, None, None, 0)
        delay = status.delay()
        return cls(
            getattr(ring, "current_t", None), getattr(ring, "dropped_packets", None),
            None if delay is None else max(float(delay), 0.0), int(ring.backlog),
        )  # fmt: skip


class Drops:
    """Lost packets, each counted once.

    The driver tells them twice: as a number that grows from the opening of the camera, and as the places of a packet's
    columns at which some are missing, which it leaves out of a packet without events. The number is the truth; places
    that it has not (yet) heard of count as one packet each.
    """

    def __init__(self) -> None:
        self._dropped = self._places = self._told = self._last = 0

    def opened_again(self) -> None:
        """The driver's number begins at 0 again."""
        self._last = 0

    def since(self, num_dropped: int | None, num_places: int) -> int:
        """Packets lost since the last call."""
        if num_dropped is not None:
            self._dropped += num_dropped - (self._last if num_dropped >= self._last else 0)
            self._last = num_dropped
        self._places += num_places
        lost = max(self._dropped, self._places)
        num_lost, self._told = lost - self._told, lost
        return num_lost


def num_overflows(packet: Any) -> int:
    """How often USB packets are missing in a packet (or `None`): in each column with something in it, at the same
    moments."""
    kinds = ("polarity_events", "trigger_events", "imu_events", "frames")
    columns = (getattr(packet, f"{kind}_overflow_indices", None) for kind in kinds)
    return max(0 if column is None else len(column) for column in columns)
