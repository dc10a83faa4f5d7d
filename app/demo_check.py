"""`etnet-view --demo --check`: everything that a demo needs is tried without a browser, and what will fail is said."""

from __future__ import annotations

import asyncio
import json
import shutil
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol
from urllib.parse import urlsplit

from app.session.rehearsal import rehearse
from etnet.errors import EtnetError

if TYPE_CHECKING:
    from app.catalogue.mirror import Mirrors
    from app.catalogue.recordings import Catalogue
    from app.config import ViewerConfig
    from app.engine.engine import Engine
    from app.state.view_state import ViewState

SLOWEST_STEP = 0.5
"""Seconds of one image above which the show looks like a slide show."""
FEWEST_MIRRORED = 5.0
"""Camera pictures a second that the simulated pixels must keep up with."""
MIRROR_SECONDS = 3.0
LEAST_DISK = 1 << 30
STATIC = ("channel.js", "tidy.js", "booth.js", "camera.js", "demo.css", "help.html")


class Running(Protocol):
    """As much of a running viewer as is tried."""

    catalogue: Catalogue
    engine: Engine
    default: ViewState
    mirrors: Mirrors | None
    token: str | None
    port: int

    @property
    def url(self) -> str:
        """Its address."""
        ...


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was tried: what, whether it will do, and what to do where it will not."""

    name: str
    is_good: bool
    words: str


def check_demo(viewer: Running, config: ViewerConfig) -> Iterator[Finding]:
    """Try everything, one after the other."""
    yield _pages(viewer)
    for entry in viewer.catalogue.entries():
        yield _recording(viewer, entry.id, entry.title)
    yield _foreign(viewer)
    if viewer.mirrors is not None:
        yield _secure(config)
        yield _mirror(viewer)
    free = shutil.disk_usage(tempfile.gettempdir()).free
    words = f"{free / 1e9:.1f} GB free for uploads and videos"
    yield Finding("disk", free > LEAST_DISK, words if free > LEAST_DISK else f"{words}; make room: 1 GB at least")


def _tried(name: str, what: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, what())
    except (EtnetError, OSError, ValueError) as error:
        return Finding(name, False, str(error))


def _pages(viewer: Running) -> Finding:
    def look() -> str:
        for path in ("", *(f"static/{name}" for name in STATIC)):
            with urllib.request.urlopen(_local(viewer, path), timeout=10) as answer:
                if answer.status != 200:
                    raise EtnetError(f"/{path} answers {answer.status}")
        return f"the page and its {len(STATIC)} parts are served at {viewer.url}"

    return _tried("page", look)


def _recording(viewer: Running, recording_id: str, title: str) -> Finding:
    def render() -> str:
        view = replace(viewer.default, recording_id=recording_id)
        made = rehearse(viewer.engine, viewer.catalogue, view, lambda done, total: None, most=12)
        if made.step > SLOWEST_STEP:
            raise EtnetError(
                f"{title}: an image takes {made.step:.2f} s here; take --downsample 2, or a faster machine"
            )
        return f"{made.num_images} images, {made.step:.2f} s each"

    return _tried(f"recording {title}", render)


def _foreign(viewer: Running) -> Finding:
    request = urllib.request.Request(_local(viewer, ""), headers={"Host": "elsewhere.example"})
    try:
        with urllib.request.urlopen(request, timeout=10):
            return Finding("guard", False, "the viewer answers to a foreign host name; do not show it")
    except urllib.error.HTTPError as error:
        return Finding("guard", error.code == 421, "foreign host names are refused")
    except OSError as error:
        return Finding("guard", False, str(error))


def _secure(config: ViewerConfig) -> Finding:
    if config.public_url is not None and urlsplit(config.public_url).scheme != "https":
        return Finding("camera", False, f"{config.public_url}: browsers give their camera to https alone; use TLS")
    return Finding("camera", True, "pages on this machine, or over https, may ask for the camera")


def _mirror(viewer: Running) -> Finding:
    return _tried("mirror", lambda: asyncio.run(_look_into(viewer)))


async def _look_into(viewer: Running) -> str:
    import numpy as np
    from websockets.asyncio.client import connect

    assert viewer.mirrors is not None
    mirror, num_seen = viewer.mirrors.mirror(), 0
    address = _local(viewer, "camera").replace("http://", "ws://", 1)
    try:
        async with connect(address, compression=None) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            width, height = json.loads(await socket.recv())["go"]
            began = time.monotonic()
            y, x = np.mgrid[:height, :width]
            while (now := time.monotonic() - began) < MIRROR_SECONDS:
                grey = 128 + 90 * np.sin((x - 40 * now) / 9) * np.cos((y + 15 * now) / 11)
                await socket.send(grey.astype(np.uint8).tobytes())
                await socket.recv()
                num_seen += 1
    finally:
        await asyncio.to_thread(mirror.close)
    rate = num_seen / MIRROR_SECONDS
    if rate < FEWEST_MIRRORED:
        raise EtnetError(
            f"the simulated sensor sees {rate:.1f} pictures a second; wanted {FEWEST_MIRRORED:g}: close other programs"
        )
    return f"the simulated sensor sees {rate:.0f} pictures a second"


def _local(viewer: Running, path: str) -> str:
    token = f"?token={viewer.token}" if viewer.token else ""
    return f"http://127.0.0.1:{viewer.port}/{path}{token}"
