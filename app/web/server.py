"""The guarded viser server: where it listens, how its page looks, and one session for each visitor."""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Callable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from io import StringIO
from typing import Any, Protocol

import viser
from websockets.asyncio.server import ServerConnection

from app.html.assets import page_folder
from app.web.access import LOOPBACK, NOTEBOOKS, AccessControl, Handler
from app.web.guarding import guarding
from app.web.idle_memory import IdleMemory, share_arenas
from app.web.index_page import IndexPage
from app.web.outgoing import escape_outgoing
from app.web.requests import public_origin
from etnet.errors import EtnetError

BRAND = (185, 181, 255)
"""The accent of the interface: no hue of polarity."""
PORTS_TRIED = 50
CROWDED = "This page takes a limited number of visitors at once. It looks for a place again by itself, twice a minute."


class AddressError(EtnetError):
    """The viewer cannot listen where it was told to."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where to listen, the token visitors need, and the public URL's host if a proxy stands in front."""

    host: str = "127.0.0.1"
    port: int = 8080
    token: str | None = None
    public_url: str | None = None
    is_embedded: bool = False
    """Whether a notebook shows it in a frame."""

    @property
    def is_loopback(self) -> bool:
        """Whether only this machine can reach it."""
        return self.host in LOOPBACK or self.host == "::1"


class VisitorSession(Protocol):
    """What the server needs of a session."""

    def close(self) -> None:
        """The visitor has gone."""
        ...


def free_port(host: str, port: int) -> int:
    """`port`, or the next one that is free."""
    for candidate in range(port, min(port + PORTS_TRIED, 65_536)):
        try:
            _bind_once(host, candidate)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise AddressError(
                    f"cannot listen on {host}:{candidate} ({error.strerror}); try --host 127.0.0.1"
                ) from error
        else:
            return candidate
    raise AddressError(f"no free port from {port} to {port + PORTS_TRIED - 1} on {host}; name one with --port")


def start_server(
    address: Address,
    port: int,
    visit: Callable[[viser.ClientHandle], VisitorSession],
    most_visitors: int | None = None,
    doors: Mapping[str, Handler] | None = None,
    pages: Callable[[str], bytes | None] = lambda path: None,
    index: IndexPage | None = None,
) -> viser.ViserServer:
    """Serve the page on `port`. `visit` makes one session a visitor, on its own thread; it is closed when they leave.

    A visitor who comes when `most_visitors` are here already is told so, and gets no session. `doors` are
    websockets beside viser's, `pages` whole pages, by their path, `index` is the page itself.
    """
    public = public_origin(address.public_url) if address.public_url else None
    if address.public_url and public is None:
        raise AddressError(
            f"--public-url {address.public_url}: wanted an address such as https://show.example, without a path"
        )
    if address.token == "":
        raise AddressError("an empty token lets everybody in; give one of your own, or none")
    guard = AccessControl(
        page_folder(),
        address.token,
        LOOPBACK | {_bracketed(address.host).lower()},
        public,
        (index or IndexPage(address.public_url)).dressed,
        doors or {},
        pages,
        NOTEBOOKS if address.is_embedded else "'self'",
        address.host in ("0.0.0.0", "::"),
    )
    share_arenas()
    escape_outgoing()
    made: list[viser.ViserServer] = []

    def widget(connection: ServerConnection, uuid: str) -> Any:
        return _widget(made[0], connection, uuid) if made else None

    # viser prints a frame with addresses of its own; this program says where to look in one line.
    with guarding(guard, widget), redirect_stdout(StringIO()):
        server = viser.ViserServer(host=address.host, port=port, label="ET-Net viewer", verbose=False)
    made.append(server)
    # Any page in the browser may ask viser to publish itself through a tunnel on a foreign server: never here.
    server.request_share_url = lambda verbose=True: None
    _dress(server)
    _welcome(server, visit, most_visitors)
    return server


def _dress(server: viser.ViserServer) -> None:
    server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=BRAND)
    server.scene.configure_default_lights(enabled=False)
    # x right, y down as on the sensor. It must stand before the first visitor's camera is placed.
    server.scene.set_up_direction("-y")
    server.initial_camera.up = (0.0, -1.0, 0.0)


def _welcome(
    server: viser.ViserServer, visit: Callable[[viser.ClientHandle], VisitorSession], most_visitors: int | None
) -> None:
    visits: dict[int, VisitorSession] = {}
    admitted: set[int] = set()
    """Who has a place: who was told to come later looks on, and has none."""
    upkeep = IdleMemory()

    def build(client: viser.ClientHandle) -> VisitorSession | None:
        """`None` for a page that has gone while it waited for a worker: pages that come and go by the hundred would
        keep the workers from everybody's files and cameras, too."""
        return visit(client) if client.client_id in server.get_clients() else None

    @server.on_client_connect
    async def _(client: viser.ClientHandle) -> None:
        upkeep.while_here(lambda: bool(server.get_clients()))
        if most_visitors is not None and len(admitted) >= most_visitors:
            client.gui.add_html(f'<div class="etv-crowded"><b>Many are looking already</b><p>{CROWDED}</p></div>')
            return
        admitted.add(client.client_id)
        # A session is built in a worker: laying out a page would hold up every other visitor's clicks.
        built = await asyncio.to_thread(build, client)
        if built is None:
            return
        if client.client_id in server.get_clients():
            visits[client.client_id] = built
        else:
            built.close()

    @server.on_client_disconnect
    async def _(client: viser.ClientHandle) -> None:
        admitted.discard(client.client_id)
        if (gone := visits.pop(client.client_id, None)) is not None:
            gone.close()
        upkeep.after_visit()


def _widget(server: viser.ViserServer, connection: ServerConnection, uuid: str) -> Any:
    """The widget of a connection's page by its id; `None` where it has none such (any more)."""
    # A copy: the dictionary is written by the same event loop, and by viser's own teardown.
    live = dict(server._websock_server._live_connections)
    number = next((number for number, held in live.items() if held is connection), None)
    client = None if number is None else server._connected_clients.get(number)
    return None if client is None else client.gui._gui_input_handle_from_uuid.get(uuid)


def _bind_once(host: str, port: int) -> None:
    family, kind, protocol, _, bound = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    with socket.socket(family, kind, protocol) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(bound)


def _bracketed(host: str) -> str:
    return f"[{host}]" if ":" in host and not host.startswith("[") else host


def installed_version() -> str:
    """This project's version, or "a checkout"."""
    try:
        return version("etnet")
    except PackageNotFoundError:
        return "a checkout"
