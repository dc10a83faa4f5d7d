"""Events over UDP, in the two layouts that faery sends. What is not read in time is dropped by the system."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.address import Address, bound, is_ready
from etnet.live.layouts import RECORD_BYTES, LayoutName, WrongBytes, decoder_of
from etnet.live.source import Packet, WithoutSettings

DATAGRAM = 1 << 16
"""Bytes of the largest datagram."""
DATAGRAMS = 512
"""Datagrams that become one packet at most."""
RECEIVE_BUFFER = 8 << 20
"""Bytes that the system is asked to hold of datagrams that were not read yet."""


@dataclass(eq=False)
class UdpStream(WithoutSettings):
    """Datagrams of whole records. Those that come late, or are no events of this sensor, are left out and counted."""

    address: Address
    sensor: Sensor
    layout: LayoutName = "t64_x16_y16_on8"
    _socket: socket.socket = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.layout == "es":
            raise RecordingError(f"{self.address}: datagrams hold whole records; send Event Stream over TCP instead")
        self._socket = bound(self.address, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)

    @property
    def name(self) -> str:
        """The address."""
        return str(self.address)

    @property
    def format(self) -> str:
        """The layout."""
        return f"{self.layout} over UDP"

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return self._socket.getsockname()[1]

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """All datagrams that wait, as one packet."""
        decoder, last = decoder_of(self.layout, self.sensor), -1
        was_wrong = False
        while not is_stopped():
            parts: list[Events] = []
            num_lost, notes = 0, ()
            for content in self._waiting():
                num_whole = len(content) // RECORD_BYTES[self.layout]
                num_lost += num_whole * RECORD_BYTES[self.layout] < len(content)
                try:
                    events = decoder.decode(content[: num_whole * RECORD_BYTES[self.layout]])
                except WrongBytes as error:
                    num_lost += 1
                    decoder = decoder_of(self.layout, self.sensor)
                    if not was_wrong:
                        notes = (f"{self.name}: wrong bytes ({error}); datagrams like this are left out and counted",)
                    was_wrong = True
                    continue
                if len(events) and events.t[0] >= last:
                    last = int(events.t[-1])
                    parts.append(events)
                    was_wrong = False
                elif len(events) and last - int(events.t[0]) > 1_000_000:
                    last = int(events.t[-1])  # another sender, or one that began again: the clock is set right later
                    parts.append(events)
                elif len(events):
                    num_lost += 1
            yield Packet(Events.concatenate(parts, self.sensor), num_lost=num_lost, notes=notes)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _waiting(self) -> Iterator[bytes]:
        """The datagrams that are there; none after `PATIENCE` without any."""
        if not is_ready(self._socket):
            return
        for _ in range(DATAGRAMS):
            try:
                yield self._socket.recv(DATAGRAM, socket.MSG_DONTWAIT)
            except (BlockingIOError, InterruptedError):
                return
