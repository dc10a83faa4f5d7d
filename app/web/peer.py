"""Where a visitor's connection comes from: by itself, and by its own word."""

from __future__ import annotations

from contextvars import ContextVar
from dataclasses import dataclass
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection

from app.web.access import LOOPBACK

LOOPBACK_PEERS = frozenset({"127.0.0.1", "::1", "::ffff:127.0.0.1"})


@dataclass(frozen=True, slots=True)
class _Peer:
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


def note_peer(connection: ServerConnection) -> None:
    """What is done from here on, in this task, is done for this connection."""
    assert connection.request is not None
    headers = connection.request.headers
    origins = [urlsplit(origin).netloc for origin in headers.get_all("Origin")]
    hosts = tuple(_host_name(host) for host in (*headers.get_all("Host"), *origins))
    is_forwarded = any(name.lower().startswith(("x-forwarded", "forwarded", "x-real-ip", "via")) for name in headers)
    address = connection.remote_address
    _PEER.set(_Peer(str(address[0]) if address else "", hosts, is_forwarded))


def _host_name(host: str) -> str:
    return host if host.endswith("]") else host.rsplit(":", 1)[0]
