"""Events over standard input, TCP or UDP, so that any driver can feed us. One sender at a time, loopback unless stated.

Nothing queues up here: what is not read waits at the sender (standard input, TCP) or is dropped by the system (UDP).
"""

from __future__ import annotations

import math
import os
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO, Literal

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.layouts import EVENT_STREAM_HEAD, Decoder, LayoutName, WrongBytes, decoder_of, event_stream_sensor
from etnet.live.source import Packet, WithoutSettings

PIECE = 1 << 20
"""Bytes that are read at once."""
DATAGRAM = 1 << 16
"""Bytes of the largest datagram."""
DATAGRAMS = 512
"""Datagrams that become one packet at most."""
PATIENCE = 0.1
"""Seconds from one look at whether to stop to the next."""
HEAD_PATIENCE = 10.0
"""Seconds that a sender may take to say what it sends."""
RECEIVE_BUFFER = 8 << 20
"""Bytes that the system is asked to hold of datagrams that were not read yet."""

Transport = Literal["stdin", "tcp", "udp"]


@dataclass(frozen=True, slots=True)
class Address:
    """Where a stream comes in: standard input, or a port on this machine under one of its addresses."""

    transport: Transport
    host: str = "127.0.0.1"
    port: int = 0

    def __post_init__(self) -> None:
        if self.transport != "stdin" and not 0 <= self.port <= 65_535:
            raise RecordingError(f"{self.transport}: port {self.port}; ports are 1 to 65,535")

    def __str__(self) -> str:
        return self.transport if self.transport == "stdin" else f"{self.transport}:{self.host}:{self.port}"


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
        self._socket = _bound(self.address, socket.SOCK_DGRAM)
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
                try:
                    events = decoder.decode(content)
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
        if not _is_ready(self._socket):
            return
        for _ in range(DATAGRAMS):
            try:
                yield self._socket.recv(DATAGRAM, socket.MSG_DONTWAIT)
            except (BlockingIOError, InterruptedError):
                return


class Listener:
    """A port on which senders connect, one after the other."""

    def __init__(self, address: Address, layout: LayoutName = "es", stated: Sensor | None = None) -> None:
        _check_stated(address, layout, stated)
        self.layout: LayoutName = layout
        self.address, self.stated = address, stated
        self._socket = _bound(address, socket.SOCK_STREAM)
        self._socket.listen(1)

    @property
    def port(self) -> int:
        """The port that it listens on."""
        return self._socket.getsockname()[1]

    @property
    def host(self) -> str:
        """The address of this machine that it listens under."""
        return self._socket.getsockname()[0]

    def sender(self) -> socket.socket | None:
        """A sender that waits; `None` after `PATIENCE` without one."""
        return self._socket.accept()[0] if _is_ready(self._socket) else None

    def stream(self, is_stopped: Callable[[], bool] = lambda: False, patience: float = math.inf) -> TcpStream:
        """The source. Where the sensor's size is not stated, the first sender is waited for, whose header tells it."""
        if self.stated is not None:
            return TcpStream(self, self.stated)
        until = time.monotonic() + patience
        while time.monotonic() < until and not is_stopped():
            sender = self.sender()
            if sender is not None:
                try:
                    return TcpStream(self, event_stream_sensor(_head(sender, is_stopped)), sender)
                except (WrongBytes, OSError):
                    sender.close()
        raise RecordingError(f"{self.address}: nobody sent anything; start the sender, it has to connect here")

    def close(self) -> None:
        """Close the port."""
        self._socket.close()


@dataclass(eq=False)
class TcpStream(WithoutSettings):
    """What one sender at a time sends, and the next one when it hangs up or sends what is no events."""

    listener: Listener
    sensor: Sensor
    _sender: socket.socket | None = field(default=None, repr=False)
    """One whose header was read."""

    @property
    def name(self) -> str:
        """The address."""
        return str(self.listener.address)

    @property
    def format(self) -> str:
        """The layout."""
        return f"{_words(self.listener.layout)} over TCP"

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """What one sender after the other sends."""
        layout, has_head = self.listener.layout, self._sender is not None
        while not is_stopped():
            if self._sender is None:
                self._sender = self.listener.sender()
                if self._sender is None:
                    yield Packet(Events.empty(self.sensor))
                    continue
            note, num_lost = "the sender hung up; waiting for it", 0
            try:
                if layout == "es" and not has_head:
                    _check_same(event_stream_sensor(_head(self._sender, is_stopped)), self.sensor)
                decoder = decoder_of(layout, self.sensor)
                yield from self._sent(self._sender, decoder, is_stopped)
            except WrongBytes as error:
                note, num_lost = f"wrong bytes ({error}); the connection was closed, waiting for another", 1
            except OSError as error:
                note = f"the connection broke ({error.strerror or error}); waiting for another"
            self._sender.close()
            self._sender, has_head = None, False
            if not is_stopped():
                yield Packet(Events.empty(self.sensor), num_lost=num_lost, notes=(f"{self.name}: {note}",))

    def close(self) -> None:
        """Close the sockets."""
        self.listener.close()
        if self._sender is not None:
            self._sender.close()

    def _sent(self, sender: socket.socket, decoder: Decoder, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        while not is_stopped():
            if not _is_ready(sender):
                yield Packet(Events.empty(self.sensor))
                continue
            content = sender.recv(PIECE)
            if not content:
                return
            yield Packet(decoder.decode(content))


@dataclass(eq=False)
class InputStream(WithoutSettings):
    """Standard input, to its end."""

    address: Address
    stated: Sensor | None = None
    layout: LayoutName = "es"
    file: BinaryIO | None = None
    sensor: Sensor = field(init=False)

    def __post_init__(self) -> None:
        _check_stated(self.address, self.layout, self.stated)
        self._number = (self.file or sys.stdin.buffer).fileno()
        if self.layout == "es":
            head = b""
            while len(head) < EVENT_STREAM_HEAD and (more := os.read(self._number, EVENT_STREAM_HEAD - len(head))):
                head += more
            try:
                self.sensor = event_stream_sensor(head)
            except WrongBytes as error:
                raise RecordingError(
                    f"{self.name}: {error}; state --layout and --sensor if it is another layout"
                ) from error
        elif self.stated is not None:
            self.sensor = self.stated

    @property
    def name(self) -> str:
        """Standard input."""
        return "stdin"

    @property
    def format(self) -> str:
        """The layout."""
        return f"{_words(self.layout)} from standard input"

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """What comes, until it ends."""
        decoder = decoder_of(self.layout, self.sensor)
        while not is_stopped():
            if not select.select([self._number], [], [], PATIENCE)[0]:
                yield Packet(Events.empty(self.sensor))
                continue
            content = os.read(self._number, PIECE)
            if not content:
                return
            try:
                events = decoder.decode(content)
            except WrongBytes as error:
                raise RecordingError(f"{self.name}: wrong bytes ({error}); nothing after them can be read") from error
            yield Packet(events)

    def close(self) -> None:
        """Standard input is the program's."""


def _bound(address: Address, kind: socket.SocketKind) -> socket.socket:
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    here = socket.socket(family, kind)
    try:
        if kind == socket.SOCK_STREAM:
            here.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        here.bind((address.host, address.port))
    except OSError as error:
        here.close()
        raise RecordingError(
            f"{address}: cannot listen there ({error.strerror or error}); choose another port or address"
        ) from error
    return here


def _is_ready(here: socket.socket) -> bool:
    try:
        return bool(select.select([here], [], [], PATIENCE)[0])
    except (OSError, ValueError) as error:
        raise RecordingError("the socket was closed") from error


def _head(sender: socket.socket, is_stopped: Callable[[], bool]) -> bytes:
    """The first bytes of an Event Stream, no more; fewer if the sender hangs up, or takes too long over them."""
    head, until = b"", time.monotonic() + HEAD_PATIENCE
    while len(head) < EVENT_STREAM_HEAD and time.monotonic() < until and not is_stopped():
        if _is_ready(sender):
            more = sender.recv(EVENT_STREAM_HEAD - len(head))
            if not more:
                break
            head += more
    return head


def _check_same(sensor: Sensor, wanted: Sensor) -> None:
    if sensor != wanted:
        raise WrongBytes(f"its sensor is {sensor}, the one before had {wanted}")


def _check_stated(address: Address, layout: LayoutName, stated: Sensor | None) -> None:
    if layout != "es" and stated is None:
        raise RecordingError(f"{address}: {layout} does not tell the sensor's size; state it: --sensor 346x260")


def _words(layout: LayoutName) -> str:
    return "Event Stream" if layout == "es" else layout
