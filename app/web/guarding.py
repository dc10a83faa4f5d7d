"""Puts the guard before viser's server: every request, every handshake and every message passes here first.

viser calls websockets' `serve` and takes no check of ours, so that function is wrapped while its server is made.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import viser
import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from app.web.access import AccessControl, Handler, answer
from app.web.guarded_connection import GuardedConnection, Rate
from app.web.messages import MessageError, fate_of, read_message
from app.web.peer import note_peer

LARGEST_MESSAGE = 300_000
"""Bytes of one message of a page: a little more than the largest that ours sends, a chunk of a file. A connection
holds up to 16 of them before it stops reading."""
SILENCE = 20.0
"""Seconds in which a page says where it looks; viser counts it as a visitor from then on."""
MOST_SOCKETS = 64
"""Websockets of one address at once. All that comes through a proxy on this machine is told apart by what it says."""
MOST_SILENT = 32
"""Of one address, beside these, that have not said yet where they look or what they bring. For one more the oldest of
them goes: who opens sockets and says nothing keeps nobody else of the same address out."""
RATE, BURST = 150.0, 300.0
"""Messages a second of one page that are read, and how many may come at once. A page that sends more waits."""
CLOSING = 1.0
"""Seconds that a page has for ending a connection that is closed on it."""
ANSWERED = 60.0
"""Seconds from a connection's begin until its answer is taken: the page's 668 kB over a line of 11 kB/s."""

Widget = Callable[[ServerConnection, str], Any]
"""The widget of a connection's page by its id; `None` where there is none."""
ProcessRequest = Callable[[ServerConnection, Request], Awaitable[Response | None] | Response | None]

_log = logging.getLogger(__name__)


@contextmanager
def guarding(guard: AccessControl, widget: Widget = lambda connection, uuid: None) -> Iterator[None]:
    """Servers that are constructed inside are guarded."""
    original = websocket_server.serve

    def serve(
        handler: Handler, *args: object, process_request: ProcessRequest | None = None, **options: object
    ) -> object:
        asyncio.get_running_loop().set_exception_handler(_note)
        gate = Gate(guard, handler, process_request, widget)
        options |= {
            "max_size": LARGEST_MESSAGE,
            "create_connection": partial(GuardedConnection, Counter(), guard.public is not None),
            "process_response": gate.dress,
            "server_header": None,
            # A few hundred bytes would unpack to a whole message before it is counted; viser packs by itself.
            "compression": None,
            "close_timeout": CLOSING,
            "open_timeout": ANSWERED,  # of the request itself `GuardedConnection` is the judge
        }
        return original(gate.handle, *args, process_request=gate.ask, **options)  # pyright: ignore[reportArgumentType, reportCallIssue]

    websocket_server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websocket_server.serve = original


class Gate:
    """One server's gate, used on its event loop alone."""

    def __init__(
        self, guard: AccessControl, handler: Handler, process_request: ProcessRequest | None, widget: Widget
    ) -> None:
        self._guard = guard
        self._handler = handler
        self._process = process_request
        self._widget = widget
        self._sockets: Counter[str] = Counter()
        self._silent: dict[str, dict[ServerConnection, None]] = {}

    def ask(self, connection: ServerConnection, request: Request) -> Awaitable[Response | None] | Response | None:
        """The answer to a request; `None` where it becomes a websocket."""
        address = address_of(connection, request, behind_proxy=self._guard.public is not None)
        own = self._guard.refuse_or_answer(request, connection.local_address[1], address)
        if own is not None:
            return own
        is_websocket = request.headers.get("Upgrade", "").lower() == "websocket"
        if is_websocket:
            is_full = self._sockets[address] >= MOST_SOCKETS
            return answer(429, "too many pages are open from your address") if is_full else None
        if self._process is None:
            return None
        try:
            found = self._process(connection, request)
        except (OSError, ValueError, LookupError):  # a path that no file can have, a header that stands twice
            return answer(404, "not found")
        return self._guard.dress(found) if isinstance(found, Response) else found

    def dress(self, connection: ServerConnection, request: Request, response: Response) -> None:
        """What every answer carries."""
        self._guard.secured(response)
        if response.status_code != 101:
            # It counts as sent when none of it waits here any more: what still waits then is thrown away.
            connection.transport.set_write_buffer_limits(0, 0)

    async def handle(self, connection: ServerConnection) -> None:
        """Serve a websocket to its end."""
        assert connection.request is not None
        note_peer(connection)
        address = address_of(connection, connection.request, behind_proxy=self._guard.public is not None)
        door = self._guard.doors.get(urlsplit(connection.request.path).path)
        if door is not None:
            with ExitStack() as stack:
                stack.enter_context(self._listed_silent(connection, address))
                _on_first(connection, lambda: self._speaks(stack, address))
                await door(connection)
        elif connection.subprotocol != f"viser-v{viser.__version__}":
            # By the code viser's page knows what to say; a stranger is not told what runs here.
            await connection.close(1002, "another version of this page; load it again")
        else:
            with ExitStack() as stack:
                stack.enter_context(self._listed_silent(connection, address))
                Checked(connection, self._widget, lambda: self._speaks(stack, address)).begin()
                await self._handler(connection)

    def _speaks(self, stack: ExitStack, address: str) -> None:
        """A page has said where it looks, or what it brings: it counts among the others of its address from now on."""
        stack.close()
        stack.enter_context(self._counted(address))

    @contextmanager
    def _counted(self, address: str) -> Iterator[None]:
        self._sockets[address] += 1
        try:
            yield
        finally:
            self._sockets[address] -= 1
            if not self._sockets[address]:
                del self._sockets[address]

    @contextmanager
    def _listed_silent(self, connection: ServerConnection, address: str) -> Iterator[None]:
        listed = self._silent.setdefault(address, {})
        if len(listed) >= MOST_SILENT:
            oldest = next(iter(listed))
            del listed[oldest]
            oldest.transport.abort()
        listed[connection] = None
        try:
            yield
        finally:
            listed.pop(connection, None)
            if not listed and self._silent.get(address) is listed:
                del self._silent[address]


class Checked:
    """Reads a page's messages for viser: none that ours does not send, none too fast, the first one in time."""

    def __init__(self, connection: ServerConnection, widget: Widget, on_first: Callable[[], object]) -> None:
        """`on_first` is told when the page has said where it looks."""
        self._connection = connection
        self._widget = widget
        self._on_first = on_first
        self._receive = connection.recv
        self._is_first = True
        self._rate = Rate(RATE, BURST)

    def begin(self) -> None:
        """From now on viser gets what passes."""
        self._connection.recv = self._recv  # pyright: ignore[reportAttributeAccessIssue]

    async def _recv(self, decode: bool | None = None) -> bytes:
        while True:
            await self._rate.wait()
            try:
                raw = await asyncio.wait_for(self._receive(), SILENCE if self._is_first else None)
                message = read_message(raw, self._is_first)
            except TimeoutError:
                await self._close("a page that does not say where it looks")
                continue
            except MessageError as error:
                await self._close(str(error))
                continue
            if self._is_first:
                self._is_first = False
                self._on_first()
            if message.kind == "GuiUpdateMessage":
                held = self._widget(self._connection, message.fields["uuid"])
                fate = "drop" if held is None else fate_of(held, message.fields["updates"]["value"])
                if fate == "close":
                    await self._close("a value that its widget does not take")
                if fate != "pass":
                    continue
            return message.raw

    async def _close(self, why: str) -> None:
        """End the connection with a code; the next `recv` raises ConnectionClosed."""
        _log.warning("a page was cut off: it sent %s", why, extra={"kind": "cut off"})
        with suppress(ConnectionClosed, TimeoutError):
            await asyncio.wait_for(self._connection.close(1008, "not what this page sends"), CLOSING)
            return
        self._connection.transport.abort()


def _on_first(connection: ServerConnection, tell: Callable[[], object]) -> None:
    """Tell of the first message that a connection receives."""
    receive = connection.recv

    async def recv(decode: bool | None = None) -> str | bytes:
        message = await receive(decode)
        connection.recv = receive  # pyright: ignore[reportAttributeAccessIssue]
        tell()
        return message

    connection.recv = recv  # pyright: ignore[reportAttributeAccessIssue]


def address_of(connection: ServerConnection, request: Request, behind_proxy: bool) -> str:
    """Who a connection comes from. What a proxy says of it counts where one on this machine is announced."""
    peer = connection.remote_address
    address = str(peer[0]) if isinstance(peer, tuple) and peer else ""
    if behind_proxy and address in ("127.0.0.1", "::1"):
        forwarded = request.headers.get_all("X-Forwarded-For")
        # The proxy adds what it saw itself at the end; what stands before is the visitor's own word.
        said = forwarded[-1].rsplit(",", 1)[-1].strip()[:64] if forwarded else ""
        return said or address
    return address


def _note(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """What goes wrong in viser's callbacks is one bounded line, not a traceback a message."""
    error = context.get("exception")
    if isinstance(error, ConnectionClosed):
        return
    _log.warning(
        "%s", context.get("message", "a callback failed"), exc_info=error if isinstance(error, Exception) else None
    )
