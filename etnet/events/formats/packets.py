"""Structured arrays as libraries hand them out, a few thousand events at a time, joined to pieces worth a call."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.base import Request, contained
from etnet.events.formats.collect import Decoded

_ENOUGH = 1 << 17
_LARGE = 1 << 13
"""A packet of so many events is worth a call of its own, and is not copied to join others."""


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
        """The events, joined. A piece is overwritten by the next one: fresh memory costs more than the copy."""
        x, y, t, p = (np.empty(2 * _ENOUGH, dtype) for dtype in ("<u2", "<u2", "<u8", "?"))
        held = Decoded(x, y, t, p)
        num_held = 0
        while (packet := self._next()) is not None:
            if num_held == 0 and _LARGE <= len(packet) <= _ENOUGH:
                fraction = self.num_events * self._bytes_per_event / self._size
                yield Decoded(packet["x"], packet["y"], packet["t"], packet["on"], fraction)
                continue
            for start in range(0, len(packet), _ENOUGH):
                part = packet[start : start + _ENOUGH]
                span = slice(num_held, num_held + len(part))
                held.x[span], held.y[span], held.t[span], held.p[span] = part["x"], part["y"], part["t"], part["on"]
                num_held = span.stop
                if num_held >= _ENOUGH:
                    yield self._front(held, num_held)
                    num_held = 0
        if num_held:
            yield self._front(held, num_held)

    def _next(self) -> np.ndarray | None:
        try:
            with contained(self._request.name, f"{self._what} after event {self.num_events}"):
                packet = self._next_packet()
        except RecordingError as slip:
            if self.num_events == 0:
                raise
            self.break_off = (
                f"the file breaks off after event {self.num_events} ({slip.__cause__}); what comes before is kept"
            )
            return None
        if packet is not None:
            self.num_events += len(packet)
        return packet

    def _front(self, held: Decoded, count: int) -> Decoded:
        fraction = self.num_events * self._bytes_per_event / self._size
        return Decoded(held.x[:count], held.y[:count], held.t[:count], held.p[:count], fraction)
