"""Structured arrays as libraries hand them out, a few thousand events at a time, joined to pieces worth a call."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.base import Request, contained
from etnet.events.formats.decode import Decoded

_ENOUGH = 1 << 13
"""Events that are worth the calls of handing them on; a packet that has them is not copied to join others."""

_MOST = 1 << 15
"""Events joined at most, unless one packet has more: what was just decoded is still in the processor's cache."""


class Packets:
    """Reads packets until there are no more; one that fails after the first is where the file breaks off.

    `next_packet` gives the next array with the fields t, x, y, on; one without events is fine, None is the end.
    """

    def __init__(
        self, request: Request, what: str, bytes_per_event: int, next_packet: Callable[[], np.ndarray | None]
    ) -> None:
        self._request = request
        self._what = what
        self._size = max(1, request.path.stat().st_size)
        self._bytes_per_event = bytes_per_event
        self._next_packet = next_packet
        self.num_events = 0
        self.break_off: str | None = None

    def pieces(self) -> Iterator[Decoded]:
        """The events, small packets joined."""
        while self.break_off is None and (packets := self._some()):
            fraction = self.num_events * self._bytes_per_event / self._size
            x, y, t, on = (_joined([packet[name] for packet in packets]) for name in ("x", "y", "t", "on"))
            yield Decoded(x, y, t, on, fraction)

    def _some(self) -> list[np.ndarray]:
        """Packets enough for a piece, none at the end. They share a guard, which costs as much as a short packet."""
        packets: list[np.ndarray] = []
        count = 0
        try:
            with contained(self._request.name, f"{self._what} after event {self.num_events}"):
                while not packets or (len(packets[0]) < _ENOUGH and count < _MOST):
                    packet = self._next_packet()
                    if packet is None:
                        break
                    if len(packet):
                        packets.append(packet)
                        count += len(packet)
        except RecordingError as slip:
            if self.num_events + count == 0:
                raise
            self.break_off = (
                f"the file breaks off after event {self.num_events + count} ({slip.__cause__}); "
                "what comes before is kept"
            )
        self.num_events += count
        return packets


def _joined(parts: list[np.ndarray]) -> np.ndarray:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
