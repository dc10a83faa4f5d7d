"""Who may talk to the viewer: the checks that stand before viser's own server, which has none.

viser answers everyone who reaches its port, whatever page sent them, so a foreign page could press buttons in a
visitor's name. The guard looks at every HTTP request and every websocket handshake before viser sees it.
"""

from __future__ import annotations

import hmac
import mimetypes
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from urllib.parse import parse_qsl, unquote, urlencode, urlsplit

import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

LOOPBACK = frozenset({"localhost", "127.0.0.1", "[::1]"})
COOKIE = "etnet_view"
LARGEST_MESSAGE = 300_000
"""Bytes of one message of a page: a little more than the largest that ours sends, a chunk of a file. A connection
holds up to 16 of them before it stops reading."""
VISER_UPLOAD = b"FileTransferStartUpload"
"""What a message that lets viser hold a file begins with, somewhere: viser keeps the bytes in memory, without a cap."""
LOOPBACK_PEERS = frozenset({"127.0.0.1", "::1", "::ffff:127.0.0.1"})
PAGE_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Content-Security-Policy": "sandbox allow-scripts allow-downloads",
    "Cache-Control": "no-store",
}
Handler = Callable[[ServerConnection], Awaitable[None]]
ProcessRequest = Callable[[ServerConnection, Request], Awaitable[Response | None] | Response | None]


@dataclass(frozen=True, slots=True)
class AccessControl:
    """Host names that may be asked for, the token (`None`: none needed), the folder served under /static/.

    `public_hosts` are the "name:port" pairs of a public URL, behind which a proxy may rewrite the Host header.
    """

    static: Path
    token: str | None = None
    hosts: frozenset[str] = LOOPBACK
    public_hosts: frozenset[str] = frozenset()
    health: str = "ok"
    dress: Callable[[Response], Response] = lambda response: response
    """What is done to viser's own answers."""
    doors: Mapping[str, Handler] = field(default_factory=dict)
    """Websockets that are not viser's, by their path."""
    pages: Callable[[str], bytes | None] = lambda path: None
    """Whole HTML pages by paths that nobody can guess: whoever was given one needs no token."""

    def refuse_or_answer(self, request: Request) -> Response | None:
        """The answer to a request that must not reach viser, or is not viser's; `None` lets it through."""
        host = request.headers.get("Host", "")
        if _host_name(host) not in self.hosts and host not in self.public_hosts:
            return _answer(421, "this viewer does not answer to that host name")
        is_websocket = request.headers.get("Upgrade", "").lower() == "websocket"
        if is_websocket and not self._is_own_page(request.headers.get("Origin"), host):
            return _answer(403, "another page may not use this viewer")

        url = urlsplit(request.path)
        if url.path == "/healthz":
            return _answer(200, self.health)
        if not is_websocket and (page := self.pages(url.path)) is not None:
            # Its own scripts alone, and as a page of nobody's: it reads neither cookie nor storage of this viewer.
            return _answer(200, page, PAGE_HEADERS)
        query = dict(parse_qsl(url.query))
        if self.token is not None and not self._knows_token(query, request):
            return _answer(401, "this viewer needs its token: open the address that was printed when it started")
        if self.token is not None and "token" in query and not is_websocket:
            return self._move_token_to_cookie(url.path, query)
        if url.path.startswith("/static/") and not is_websocket:
            return self._static_file(url.path.removeprefix("/static/"))
        return None

    def _is_own_page(self, origin: str | None, host: str) -> bool:
        # Browsers always send an Origin with a websocket; a program that sends none is no page.
        if origin is None:
            return True
        return urlsplit(origin).netloc in {host, *self.public_hosts}

    def _knows_token(self, query: dict[str, str], request: Request) -> bool:
        assert self.token is not None
        given = query.get("token") or _cookie(request.headers.get_all("Cookie"))
        return hmac.compare_digest(given.encode(), self.token.encode())

    def _move_token_to_cookie(self, path: str, query: dict[str, str]) -> Response:
        rest = urlencode({name: value for name, value in query.items() if name != "token"})
        # One leading slash only: "//elsewhere" would send the visitor to another host.
        location = "/" + path.lstrip("/\\") + (f"?{rest}" if rest else "")
        # Lax and not Strict: a link to a moment that stands on another site must open. All that another site can have
        # from it is a whole page to look at; what acts is the websocket, and `_is_own_page` refuses it to other pages.
        cookie = f"{COOKIE}={self.token}; HttpOnly; SameSite=Lax; Path=/"
        return _answer(302, "", {"Location": location, "Set-Cookie": cookie})

    def _static_file(self, path: str) -> Response:
        parts = [part for part in unquote(path).replace("\\", "/").split("/") if part]
        file = self.static.joinpath(*parts)
        if ".." in parts or "\0" in file.name or not file.is_file():
            return _answer(404, "not found")
        kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
        return _answer(200, file.read_bytes(), {"Content-Type": kind, "Cache-Control": "max-age=3600"})


@dataclass(frozen=True, slots=True)
class _Peer:
    """Where a connection comes from, by itself and by its own word."""

    address: str
    hosts: tuple[str, ...]
    is_forwarded: bool


_PEER: ContextVar[_Peer | None] = ContextVar("peer", default=None)


def sits_here(public_url: str | None) -> bool:
    """Whether the visitor who connects now opened the page on this very machine, by one of its own names.

    Behind a public address nobody does: a proxy connects in everybody's name.
    """
    peer = _PEER.get()
    if peer is None or public_url is not None or peer.is_forwarded:
        return False
    return peer.address in LOOPBACK_PEERS and all(host in LOOPBACK for host in peer.hosts)


def _peer_of(connection: ServerConnection) -> _Peer:
    assert connection.request is not None
    headers = connection.request.headers
    origins = [urlsplit(origin).netloc for origin in headers.get_all("Origin")]
    hosts = tuple(_host_name(host) for host in (*headers.get_all("Host"), *origins))
    is_forwarded = any(name.lower().startswith(("x-forwarded", "forwarded", "x-real-ip", "via")) for name in headers)
    address = connection.remote_address
    return _Peer(str(address[0]) if address else "", hosts, is_forwarded)


@contextmanager
def guarding(guard: AccessControl) -> Iterator[None]:
    """Servers that are constructed inside are guarded: viser calls websockets' `serve` and takes no check of ours."""
    original = websocket_server.serve

    def serve(
        handler: Handler, *args: object, process_request: ProcessRequest | None = None, **options: object
    ) -> object:
        def process(connection: ServerConnection, request: Request) -> Awaitable[Response | None] | Response | None:
            answer = guard.refuse_or_answer(request)
            if answer is not None or process_request is None:
                return answer
            answer = process_request(connection, request)
            return guard.dress(answer) if isinstance(answer, Response) else answer

        async def handle(connection: ServerConnection) -> None:
            assert connection.request is not None
            _PEER.set(_peer_of(connection))
            door = guard.doors.get(urlsplit(connection.request.path).path)
            await (handler(_taking_no_files(connection)) if door is None else door(connection))

        options = {**options, "max_size": LARGEST_MESSAGE}
        return original(handle, *args, process_request=process, **options)  # pyright: ignore[reportArgumentType, reportCallIssue]

    websocket_server.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield
    finally:
        websocket_server.serve = original


def _taking_no_files(connection: ServerConnection) -> ServerConnection:
    """The same connection, which ends when it wants viser to hold a file: files come in at a door that counts them.

    viser takes one in the name of any widget, and nothing in it says how large it may be.
    """
    receive = connection.recv

    async def recv(decode: bool | None = None) -> str | bytes:
        message = await receive(decode)
        if isinstance(message, bytes) and VISER_UPLOAD in message:
            await connection.close(1008, "files come in at /upload")
            return await receive(decode)  # which raises ConnectionClosed
        return message

    connection.recv = recv  # pyright: ignore[reportAttributeAccessIssue]
    return connection


def _host_name(host: str) -> str:
    return host if host.endswith("]") else host.rsplit(":", 1)[0]


def _cookie(headers: list[str]) -> str:
    jar: SimpleCookie = SimpleCookie()
    for header in headers:
        try:
            jar.load(header)
        except CookieError:
            continue
    return jar[COOKIE].value if COOKIE in jar else ""


def _answer(status: int, body: str | bytes, headers: dict[str, str] | None = None) -> Response:
    content = body.encode() if isinstance(body, str) else body
    sent = {
        "Content-Type": "text/plain; charset=utf-8",
        "Content-Length": str(len(content)),
        "X-Content-Type-Options": "nosniff",
        **(headers or {}),
    }
    return Response(status, "", Headers(sent), content)
