"""A websocket server's connection that bounds what a stranger can make it do before a message is read."""

from __future__ import annotations

import asyncio
import http
import logging
import time
from collections import Counter
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import SecurityError
from websockets.frames import CTRL_OPCODES, Frame, Opcode
from websockets.protocol import Event

from app.web.access import SECURITY_HEADERS
from app.web.peer import LOOPBACK_PEERS

MOST_CONNECTIONS = 256
"""Of one address at once, whatever they ask for."""
ASKED = 10.0
"""Seconds from a connection's begin until its request is there."""
PIECE = 8192
"""Bytes that are looked at in one go: what is cut off by what it sends is not read further."""
ODD_RATE, ODD_BURST = 20.0, 300.0
"""Frames a second of one connection that carry no message: pings, pongs, small fragments. No browser sends such by the
dozen, websockets answers and keeps them without a limit, and a hundred thousand a second hold up everybody."""
SMALL_FRAGMENT = 1024

_log = logging.getLogger(__name__)


class GuardedConnection(ServerConnection):
    """A connection that answers what is no request for a page by a code, and never by silence or 500."""

    def __init__(self, open_now: Counter[str], is_behind_proxy: bool, *args: Any, **options: Any) -> None:
        """`open_now`: connections of each address, counted by all of one server."""
        super().__init__(*args, **options)
        self._open_now, self._is_behind_proxy = open_now, is_behind_proxy
        self._counts_for = ""
        self._has_data = self._is_answered = False
        self._odd_left, self._odd_at = ODD_BURST, time.monotonic()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """One of too many of its address is ended at once: each takes a file of this process."""
        super().connection_made(transport)
        self._asks_until = self.loop.call_later(ASKED, self._end_unasked)
        peer = transport.get_extra_info("peername")
        address = str(peer[0]) if peer else ""
        if self._is_behind_proxy and address in LOOPBACK_PEERS:
            return  # all come from there
        self._counts_for = address
        self._open_now[address] += 1
        if self._open_now[address] > MOST_CONNECTIONS:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """As in websockets."""
        self._asks_until.cancel()
        if self._counts_for:
            self._open_now[self._counts_for] -= 1
            if not self._open_now[self._counts_for]:
                del self._open_now[self._counts_for]
        super().connection_lost(exc)

    def _end_unasked(self) -> None:
        if self.request is None:
            self.transport.abort()

    def data_received(self, data: bytes) -> None:
        """Look at the first bytes: websockets knows GET alone."""
        if not self._has_data:
            self._has_data = True
            method = data.split(b" ", 1)[0]
            if method != b"GET" and len(data) >= 4:
                is_method = method.isalpha() and method.isupper() and len(method) <= 10
                self._say(405 if is_method else 400)
                self.transport.close()
                return
        for start in range(0, len(data), PIECE):
            if self._is_answered or self.transport.is_closing():
                return
            super().data_received(data[start : start + PIECE])

    def process_event(self, event: Event) -> None:
        """As in websockets, for a bounded number of frames that carry no message."""
        if isinstance(event, Frame) and _is_odd(event):
            now = time.monotonic()
            self._odd_left = min(self._odd_left + (now - self._odd_at) * ODD_RATE, ODD_BURST) - 1
            self._odd_at = now
            if self._odd_left < 0:
                if not self.transport.is_closing():
                    _log.warning("a page was cut off: it sent frames without a message", extra={"kind": "cut off"})
                    self.transport.abort()
                return
        super().process_event(event)

    def send_data(self) -> None:
        """As in websockets; what was asked for and could not be read is answered first."""
        slip = self.protocol.handshake_exc
        if self._has_data and slip is not None and self.request is None:
            self._say(431 if isinstance(slip.__cause__, SecurityError) else 400)
        super().send_data()

    def _say(self, status: int) -> None:
        if self._is_answered or self.transport.is_closing():
            return
        self._is_answered = True
        phrase = http.HTTPStatus(status).phrase
        lines = [f"HTTP/1.1 {status} {phrase}", "Allow: GET", "Connection: close", "Content-Length: 0"]
        lines += [f"{name}: {value}" for name, value in SECURITY_HEADERS.items()]
        self.transport.write("\r\n".join([*lines, "", ""]).encode())


def _is_odd(frame: Frame) -> bool:
    if frame.opcode in CTRL_OPCODES:
        return frame.opcode is not Opcode.CLOSE
    return not frame.fin and len(frame.data) < SMALL_FRAGMENT


class Rate:
    """So many messages a second, and so many at once after a rest. One connection's, on its event loop alone."""

    def __init__(self, a_second: float, burst: float) -> None:
        self._a_second, self._burst = a_second, burst
        self._left, self._counted_at = burst, time.monotonic()

    async def wait(self) -> None:
        """Until one more message may be read."""
        now = time.monotonic()
        self._left = min(self._left + (now - self._counted_at) * self._a_second, self._burst) - 1
        self._counted_at = now
        if self._left < 0:
            await asyncio.sleep(-self._left / self._a_second)
