"""Events over TCP, from one sender at a time. Nothing queues up here: what is not read waits at the sender."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.address import PIECE, Address, bound, check_stated, is_ready, words
from etnet.live.layouts import EVENT_STREAM_HEAD, Decoder, LayoutName, WrongBytes, decoder_of, event_stream_sensor
from etnet.live.source import Packet, WithoutSettings

HEAD_PATIENCE = 10.0
"""Seconds that a sender may take to say what it sends."""


class Listener:
    """A port on which senders connect, one after the other."""

    def __init__(self, address: Address, layout: LayoutName = "es", stated: Sensor | None = None) -> None:
        check_stated(address, layout, stated)
        self.layout: LayoutName = layout
        self.address, self.stated = address, stated
        self._socket = bound(address, socket.SOCK_STREAM)
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
        return self._socket.accept()[0] if is_ready(self._socket) else None

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
        raise RecordingError(f"{self.address}: nothing was sent; start the sender, it has to connect here")

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
        return f"{words(self.listener.layout)} over TCP"

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
            if not is_ready(sender):
                yield Packet(Events.empty(self.sensor))
                continue
            content = sender.recv(PIECE)
            if not content:
                return
            yield Packet(decoder.decode(content), decoder.until)


def _head(sender: socket.socket, is_stopped: Callable[[], bool]) -> bytes:
    """The first bytes of an Event Stream, no more; fewer if the sender hangs up, or takes too long over them."""
    head, until = b"", time.monotonic() + HEAD_PATIENCE
    while len(head) < EVENT_STREAM_HEAD and time.monotonic() < until and not is_stopped():
        if is_ready(sender):
            more = sender.recv(EVENT_STREAM_HEAD - len(head))
            if not more:
                break
            head += more
    return head


def _check_same(sensor: Sensor, wanted: Sensor) -> None:
    if sensor != wanted:
        raise WrongBytes(f"its sensor is {sensor}, the one before had {wanted}")
