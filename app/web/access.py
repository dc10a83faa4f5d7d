"""Who may talk to the viewer: the checks that stand before viser's own server, which has none.

viser answers everyone who reaches its port, whatever page sent them, so a foreign page could press buttons in a
visitor's name. The guard looks at every HTTP request and every websocket handshake before viser sees it
(`app.web.guarding` puts it there). What is promised stands in docs/security.md.
"""

from __future__ import annotations

import gzip
import hashlib
import hmac
import mimetypes
import secrets
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import unquote, urlencode

from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from app.web.guesses import Guesses
from app.web.requests import Origin, RequestError, cookies_of, host_of, origin_of, query_of, the_only, url_of

LOOPBACK = frozenset({"localhost", "127.0.0.1", "[::1]"})
COOKIE = "etnet_view"
"""Begins a cookie's name; the port follows, because browsers keep cookies by host alone."""
VISER_UPLOAD = b"FileTransferStartUpload"
"""What a message that lets viser hold a file begins with, somewhere: viser keeps the bytes in memory, without a cap."""
PAGE_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Content-Security-Policy": "sandbox allow-scripts allow-downloads",
    "Cache-Control": "no-store",
}
"""Of a page that was taken home: it reads neither cookie nor storage of the viewer."""
SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
}
"""On every answer. `AccessControl.framed_by` adds who may frame the page."""
NOTEBOOKS = "'self' http://localhost:* http://127.0.0.1:* https://localhost:* vscode-webview:"
"""Who may frame a viewer that a notebook started."""
Handler = Callable[[ServerConnection], Awaitable[None]]


@dataclass(frozen=True, slots=True)
class AccessControl:
    """Host names that may be asked for, the token (`None`: none needed), the folder served under /static/.

    `public` is the origin of a public URL, behind which a proxy may rewrite the Host header.
    """

    static: Path
    token: str | None = None
    hosts: frozenset[str] = LOOPBACK
    public: Origin | None = None
    dress: Callable[[Response], Response] = lambda response: response
    """What is done to viser's own answers."""
    doors: Mapping[str, Handler] = field(default_factory=dict)
    """Websockets that are not viser's, by their path."""
    pages: Callable[[str], bytes | None] = lambda path: None
    """Whole HTML pages by paths that nobody can guess: whoever was given one needs no token."""
    framed_by: str = "'self'"
    takes_numbers: bool = False
    """Whether any address in numbers may be asked for, as where it listens on all of them. A foreign page's name can be
    pointed at this machine; a number cannot."""
    guesses: Guesses = field(default_factory=Guesses)
    _key: bytes = field(default_factory=lambda: secrets.token_bytes(32))
    """Of this process: a cookie of another one opens nothing, and cannot be computed from a guessed token."""

    def refuse_or_answer(self, request: Request, port: int = 0, address: str = "") -> Response | None:
        """The answer to a request that must not reach viser, or is not viser's; `None` lets it through.

        `port` is the one that was reached, `address` the visitor's.
        """
        try:
            return self._answer_to(request, port, address)
        except RequestError as error:
            return answer(400, f"this is no request of a browser: {error}")

    def _answer_to(self, request: Request, port: int, address: str) -> Response | None:
        host = host_of(the_only(request.headers, "Host") or "")
        if host is None or not (host.name in self.hosts or self._is_public(*host) or self._is_number(host.name)):
            return answer(421, "this viewer does not answer to that host name")
        is_websocket = (the_only(request.headers, "Upgrade") or "").lower() == "websocket"
        # What is reached by its public name has the public scheme, whatever the proxy speaks with this machine.
        reached = self.public if self._is_public(*host) else Origin("http", host.name, host.port or 80)
        if is_websocket and not self._is_own_page(the_only(request.headers, "Origin"), reached):
            return answer(403, "another page may not use this viewer")

        url = url_of(request.path)
        if url.path == "/healthz":
            return answer(200, "ok\n")
        if not is_websocket and (page := self.pages(url.path)) is not None:
            # Its own scripts alone, and as a page of nobody's: it reads neither cookie nor storage of this viewer.
            return answer(200, page, PAGE_HEADERS)
        query = query_of(url)
        if self.token is not None:
            refusal = self._ask_for_token(query, request, port, address)
            if refusal is not None:
                return refusal
            if "token" in query and not is_websocket:
                return self._move_token_to_cookie(url.path, query, port, self._is_public(host.name, host.port))
        if url.path.startswith("/static/") and not is_websocket:
            takes_gzip = "gzip" in (the_only(request.headers, "Accept-Encoding") or "")
            return self._static_file(url.path.removeprefix("/static/"), takes_gzip)
        return None

    def secured(self, response: Response) -> None:
        """Put what every answer carries on one."""
        policy = "Content-Security-Policy"
        # A page of its own says what it may run; who may frame it is added to that.
        own = response.headers.get(policy)
        framed = f"frame-ancestors {self.framed_by}"
        sent = {**SECURITY_HEADERS, policy: f"{own}; {framed}" if own else framed}
        for name, value in sent.items():
            if name in response.headers:
                del response.headers[name]
            response.headers[name] = value

    def _is_number(self, name: str) -> bool:
        if not self.takes_numbers:
            return False
        try:
            ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True

    def _is_public(self, name: str, port: int | None) -> bool:
        if self.public is None or name != self.public.name:
            return False
        return port == self.public.port or (port is None and self.public.port in (80, 443))

    def _is_own_page(self, origin: str | None, reached: Origin | None) -> bool:
        # Browsers always send an Origin with a websocket; a program that sends none is no page.
        if origin is None:
            return True
        found = origin_of(origin)
        return found is not None and found in (reached, self.public)

    def _ask_for_token(self, query: dict[str, str], request: Request, port: int, address: str) -> Response | None:
        assert self.token is not None
        ours = self._cookie().encode()
        for cookie in cookies_of(request.headers, cookie_name(port)):
            if hmac.compare_digest(_encoded(cookie), ours):
                return None
        given = query.get("token", "")
        if given:
            if not self.guesses.may_guess(address):
                return answer(429, "too many wrong tokens came from your address; try again in a minute")
            if hmac.compare_digest(_encoded(given), self.token.encode()):
                return None
            self.guesses.note_wrong(address)
        return answer(401, "this viewer needs its token: open the address that was printed when it started")

    def _cookie(self) -> str:
        assert self.token is not None
        return hmac.new(self._key, self.token.encode(), hashlib.sha256).hexdigest()

    def _move_token_to_cookie(self, path: str, query: dict[str, str], port: int, is_public: bool) -> Response:
        rest = urlencode({name: value for name, value in query.items() if name != "token"})
        # One leading slash only: "//elsewhere" would send the visitor to another host.
        location = "/" + path.lstrip("/\\") + (f"?{rest}" if rest else "")
        # Lax and not Strict: a link to a moment that stands on another site must open. All that another site can have
        # from it is a whole page to look at; what acts is the websocket, and `_is_own_page` refuses it to other pages.
        cookie = f"{cookie_name(port)}={self._cookie()}; HttpOnly; SameSite=Lax; Path=/"
        if is_public and self.public is not None and self.public.scheme == "https":
            cookie += "; Secure"
        return answer(302, "", {"Location": location, "Set-Cookie": cookie})

    def _static_file(self, path: str, takes_gzip: bool) -> Response:
        parts = [part for part in unquote(path).replace("\\", "/").split("/") if part]
        file = self.static.joinpath(*parts)
        try:
            if ".." in parts or "\0" in path or not file.is_file():
                return answer(404, "not found")
            content = file.read_bytes()
        except (OSError, ValueError):  # a name that is too long, or that no file can have
            return answer(404, "not found")
        kind = mimetypes.guess_type(file.name)[0] or "application/octet-stream"
        sent = {"Content-Type": kind, "Cache-Control": "max-age=3600"}
        if kind.startswith("text/") or kind.endswith(("javascript", "+xml")):
            sent["Vary"] = "Accept-Encoding"
            if takes_gzip:
                content, sent["Content-Encoding"] = _packed(content), "gzip"
        return answer(200, content, sent)


def _encoded(text: str) -> bytes:
    """What a visitor sent, whatever bytes it holds."""
    return text.encode("utf-8", "backslashreplace")


@lru_cache(maxsize=64)
def _packed(content: bytes) -> bytes:
    return gzip.compress(content, mtime=0)


def cookie_name(port: int) -> str:
    """The cookie of the viewer on a port: two viewers on one host do not take each other's place."""
    return f"{COOKIE}_{port}"


def answer(status: int, body: str | bytes, headers: dict[str, str] | None = None) -> Response:
    """A whole answer in plain text, unless `headers` say otherwise."""
    content = body.encode() if isinstance(body, str) else body
    sent = {
        "Content-Type": "text/plain; charset=utf-8",
        "Content-Length": str(len(content)),
        "Cache-Control": "no-store",
        **(headers or {}),
    }
    return Response(status, "", Headers(sent), content)
