"""Where a stream comes in, and what its sources share."""

from __future__ import annotations

import select
import socket
from dataclasses import dataclass
from typing import Literal

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.live.layouts import LayoutName

PIECE = 1 << 20
"""Bytes that are read at once."""
PATIENCE = 0.1
"""Seconds from one look at whether to stop to the next."""

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


def bound(address: Address, kind: socket.SocketKind) -> socket.socket:
    """A socket at the address. Raises RecordingError where that is taken, or none of this machine's."""
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


def is_ready(here: socket.socket | int) -> bool:
    """Whether something came within `PATIENCE`."""
    try:
        return bool(select.select([here], [], [], PATIENCE)[0])
    except (OSError, ValueError) as error:
        raise RecordingError("the socket was closed") from error


def check_stated(address: Address, layout: LayoutName, stated: Sensor | None) -> None:
    """An error where neither the layout nor anybody tells the sensor's size."""
    if layout != "es" and stated is None:
        raise RecordingError(f"{address}: {layout} does not tell the sensor's size; state it: --sensor 346x260")


def words(layout: LayoutName) -> str:
    """The layout's name for people."""
    return "Event Stream" if layout == "es" else layout
