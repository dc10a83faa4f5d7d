"""`etnet-view --demo --check`: everything that a demo needs is tried without a browser, and what will fail is said."""

from __future__ import annotations

import asyncio
import json
import shutil
import tempfile
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol
from urllib.parse import quote, urlsplit

from app.session.rehearsal import VISITOR, Mirrored, rehearse, rehearse_mirror
from app.web.index_page import STYLE_SHEETS
from etnet.errors import EtnetError

if TYPE_CHECKING:
    from app.catalogue.homes import Homes
    from app.catalogue.mirror import Mirror, Mirrors
    from app.catalogue.recordings import Catalogue
    from app.catalogue.uploads import Uploads
    from app.config import ViewerConfig
    from app.engine.engine import Engine
    from app.state.view_state import ViewState

SLOWEST_STEP = 0.5
"""Seconds of one image above which the show looks like a slide show."""
FEWEST_MIRRORED = 5.0
"""Images of the mirror a second, and camera pictures that the simulated pixels must keep up with."""
MIRROR_SECONDS = 3.0
LEAST_DISK = 1 << 30
MADE_WITHIN = 60.0
"""Seconds in which a page to take home has to be there."""


class Running(Protocol):
    """As much of a running viewer as is tried."""

    catalogue: Catalogue
    engine: Engine
    default: ViewState
    mirrors: Mirrors | None
    homes: Homes | None
    uploads: Uploads | None
    token: str | None
    host: str
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
    yield _uploads(viewer)
    if viewer.homes is not None:
        yield _home(viewer, viewer.homes)
    if config.public_url is not None:
        yield _public(config.public_url)
    free = shutil.disk_usage(tempfile.gettempdir()).free
    words = f"{free / 1e9:.1f} GB free for uploads and videos"
    yield Finding("disk", free > LEAST_DISK, words if free > LEAST_DISK else f"{words}; make room: 1 GB at least")


def _tried(name: str, what: Callable[[], str]) -> Finding:
    try:
        return Finding(name, True, what())
    except (EtnetError, OSError, ValueError) as error:
        return Finding(name, False, str(error))


def _pages(viewer: Running) -> Finding:
    # As in a browser: the token is moved into a cookie, and the page asks by that.
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())

    def look() -> str:
        with opener.open(_local(viewer, ""), timeout=10) as answer:
            page = answer.read().decode("utf-8", "replace")
        missing = [name for name in STYLE_SHEETS if f'data-sheet="{name}"' not in page]
        if missing or "etnetSay" not in page:
            raise EtnetError(f"the page comes without {', '.join(missing) or 'its scripts'}; install it again")
        with opener.open(_local(viewer, "static/icon.svg"), timeout=10):
            return f"the page, with all its styles and scripts in it, is served at {viewer.url}"

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
    def look() -> str:
        num_seen, seconds, made = asyncio.run(_look_into(viewer))
        rate = num_seen / seconds
        if rate < FEWEST_MIRRORED:
            raise EtnetError(
                f"the simulated sensor sees {rate:.1f} pictures a second; wanted {FEWEST_MIRRORED:g}: close other "
                "programs"
            )
        if made.rate < FEWEST_MIRRORED:
            raise EtnetError(
                f"the mirror shows {made.rate:.1f} images a second, {made.delay:.1f} s late; wanted "
                f"{FEWEST_MIRRORED:g}: close other programs, or start with --no-camera"
            )
        return f"the mirror shows {made.rate:.0f} images a second, {made.delay:.1f} s late, before a browser draws them"

    return _tried("mirror", look)


async def _look_into(viewer: Running) -> tuple[int, float, Mirrored]:
    """Made-up pictures come in as from a page, and the network follows them: pictures seen in so many seconds."""
    from websockets.asyncio.client import connect

    assert viewer.mirrors is not None
    mirror, began = viewer.mirrors.mirror(), time.monotonic()
    address = _local(viewer, "camera").replace("http://", "ws://", 1)
    try:
        async with connect(address, compression=None) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            width, height = json.loads(await socket.recv())["go"]
            follows = asyncio.create_task(asyncio.to_thread(_follow, viewer, mirror))
            num_seen = await _show(socket, width, height, follows)
            return num_seen, time.monotonic() - began, follows.result()
    finally:
        await asyncio.to_thread(mirror.close)


def _follow(viewer: Running, mirror: Mirror) -> Mirrored:
    return rehearse_mirror(viewer.engine, viewer.catalogue, viewer.default, mirror, MIRROR_SECONDS)


async def _show(socket: Any, width: int, height: int, follows: asyncio.Task[Mirrored]) -> int:
    """Waves that drift, a picture when the last was seen, until the network has followed for long enough."""
    import numpy as np

    num_seen, began = 0, time.monotonic()
    y, x = np.mgrid[:height, :width]
    while not follows.done():
        now = time.monotonic() - began
        grey = 128 + 90 * np.sin((x - 40 * now) / 9) * np.cos((y + 15 * now) / 11)
        await socket.send(grey.astype(np.uint8).tobytes())
        await socket.recv()
        num_seen += 1
        await asyncio.sleep(max(began + num_seen / 15 - time.monotonic(), 0.0))
    return num_seen


def _uploads(viewer: Running) -> Finding:
    if viewer.uploads is None:
        words = "visitors without a camera cannot choose a video of theirs; --uploads 64 lets them, 64 MB each"
        return Finding("uploads", True, words)
    return _tried("uploads", lambda: asyncio.run(_hand_over(viewer)))


async def _hand_over(viewer: Running) -> str:
    """A small recording comes in as from a page, and is opened."""
    from websockets.asyncio.client import connect

    assert viewer.uploads is not None
    desk = viewer.uploads.desk()
    content = b"".join(b"%.6f %d %d %d\n" % (n / 9000, n % 640, n * 7 % 480, n % 2) for n in range(9000))
    try:
        address = _local(viewer, "upload").replace("http://", "ws://", 1)
        async with connect(address, compression=None) as socket:
            await socket.send(json.dumps({"ticket": desk.ticket, "name": "tried.txt", "size": len(content)}))
            said = json.loads(await socket.recv())
            if "go" not in said:
                raise EtnetError(str(said.get("refused", said)))
            for start in range(0, len(content), said["go"]):
                await socket.send(content[start : start + said["go"]])
                await socket.recv()
            await socket.send("end")
            said = json.loads(await socket.recv())
            if "done" not in said:
                raise EtnetError(str(said.get("refused", said)))
        (entry,) = desk.entries
        recording = await asyncio.to_thread(viewer.catalogue.open, entry.id)
        return f"a file of {recording.num_events:,} events came in and was opened"
    finally:
        await asyncio.to_thread(desk.close)


def _home(viewer: Running, homes: Homes) -> Finding:
    def take() -> str:
        began, path = time.monotonic(), homes.put(_made_page(viewer))
        with urllib.request.urlopen(_local(viewer, path.lstrip("/")), timeout=10) as answer:
            size = len(answer.read())
        return f"a page of {size / 1e6:.1f} MB was made in {time.monotonic() - began:.0f} s, and is served"

    return _tried("take home", take)


def _made_page(viewer: Running) -> bytes:
    """The page to take home of the first recording's beginning, as a visitor orders it."""
    from app.catalogue.recordings import suited_policy
    from app.engine.downloads import Download
    from app.engine.jobs import JobResult
    from app.state.view_state import Limits
    from app.views.demo.state import HOME_SLOT, home_order
    from app.views.export.jobs import ExportJob
    from app.views.view import Here
    from etnet.windows import plan_windows

    recording = viewer.catalogue.open(viewer.default.recording_id)
    policy = suited_policy(recording) if viewer.default.policy is None else viewer.default.policy
    limits = Limits(recording.sensor, plan_windows(recording, policy), recording.span.start)
    order = home_order(Here(replace(viewer.default, policy=policy), limits))
    if order is None:
        raise EtnetError(f"{recording.name}: holds no events, so no page can be made of it")
    is_there, made = threading.Event(), list[JobResult]()

    def hear(slot: str, result: JobResult) -> None:
        if result.is_whole or result.trouble:
            made.append(result)
            is_there.set()

    viewer.engine.job(VISITOR, HOME_SLOT, ExportJob(order), hear)
    try:
        if not is_there.wait(MADE_WITHIN):
            raise EtnetError(f"the page was not made within {MADE_WITHIN:.0f} s; the machine is too slow, or busy")
    finally:
        viewer.engine.drop(VISITOR)
    if not isinstance(made[0].value, Download):
        raise EtnetError(made[0].trouble)
    return made[0].value.content


def _public(address: str) -> Finding:
    """The address in the code that phones read."""

    def look() -> str:
        try:
            with urllib.request.urlopen(f"{address.rstrip('/')}/healthz", timeout=10):
                return f"{address} leads here"
        except OSError as error:
            raise EtnetError(
                f"{address} does not lead here ({error}): phones that read the code find nothing"
            ) from error

    return _tried("public address", look)


def _local(viewer: Running, path: str) -> str:
    """An address of the viewer, wherever it listens, as this machine reaches it."""
    reached = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(viewer.host, viewer.host)
    token = f"?token={quote(viewer.token, safe='')}" if viewer.token else ""
    return f"http://{f'[{reached}]' if ':' in reached else reached}:{viewer.port}/{path}{token}"
