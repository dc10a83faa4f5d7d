"""Config → server → engine: the only place that constructs. The page is served before torch is imported."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any
from urllib.parse import quote
from weakref import WeakSet

from app.catalogue.folder import VIDEO_SUFFIXES
from app.catalogue.recordings import Catalogue
from app.catalogue.threads import THREADS
from app.config import ViewerConfig
from app.session_file import SUFFIX, config_of, handed_over, id_of, session_in, view_of
from app.state.view_state import ViewState
from app.web.bounded_log import bound_logs
from etnet.arguments import parsed
from etnet.errors import EtnetError, RecordingError
from etnet.events.cleaning import parse_cleaning
from etnet.files import printable
from etnet.private_folder import sweep

if TYPE_CHECKING:
    import viser

    from app.catalogue.live import LiveFeed
    from app.catalogue.visitor import VisitorCatalogue
    from app.engine.engine import Engine
    from app.session.messages import Item
    from app.session.session import Session
    from app.views.page import Page
    from app.web.access import Handler
    from app.web.server import Address
    from etnet.events.recording import Recording
    from etnet.export.session_file import Session as TakenSession


LONGEST_STEP = 30_000.0
"""Of the network (ms), where others come in: everybody waits for it."""
ENDS_WITHIN = 4.5
"""Seconds from the first signal to the end."""


def main(arguments: Sequence[str] | None = None) -> int:
    """`etnet-view`: serve until interrupted. 0 done, 1 a named failure, 2 usage."""
    bound_logs()
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if "--version" in arguments:
        print(f"etnet-view {version('etnet')}")
        return 0
    try:
        config = parsed(ViewerConfig, "etnet-view", with_a_camera(arguments))
        is_asked_to_end = _until_asked_to_end()
        viewer = Viewer(config)
    except EtnetError as error:
        print(printable(f"etnet-view: {error}"), file=sys.stderr)
        return 1
    if config.check:
        return _check(viewer, config)
    if config.demo and not _rehearse(viewer):
        return 1
    print(printable(viewer.where_to_look), flush=True)
    is_asked_to_end.wait()
    viewer.stop()
    _leave()
    return 0


def with_a_camera(arguments: Sequence[str] | None) -> list[str]:
    """The same arguments, where `--live` alone says `--live camera`."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if "--live" in given:
        after = given.index("--live") + 1
        if after == len(given) or given[after].startswith("--"):
            given.insert(after, "camera")
    return given


def open_feed(config: ViewerConfig) -> LiveFeed | None:
    """The live source of a configuration, which is not started yet."""
    from app.catalogue.live import LiveFeed
    from etnet.live.open import open_source
    from etnet.live.rate import follower_of

    if config.live is None:
        return None
    source = open_source(config.live, config.source.options(), tell=lambda said: print(said, flush=True))
    try:
        follower = follower_of(source, config.source.rate)
        return LiveFeed(source, config.source.buffer(), config.downsample, config.source.record, follower)
    except BaseException:
        source.close()
        raise


def _check_file(file: Path | None) -> None:
    """A path that no reader takes is told before anything is served; a video and a session are looked at later."""
    if file is None or file.suffix.lower() in (SUFFIX, *VIDEO_SUFFIXES):
        if file is not None and not file.exists():
            raise RecordingError(f"{file}: there is no such file; give the path of a recording")
        return
    from etnet.events.open import check_recording

    check_recording(file)


def _rehearse(viewer: Viewer) -> bool:
    """Render a demo's first recording before anybody comes; whether it can be shown."""

    def tell(done: int, total: int) -> None:
        end = "\n" if done == total else ""
        print(f"\rPreparing the first scene: image {done} of {total}", end=end, file=sys.stderr, flush=True)

    try:
        viewer.rehearse(tell)
    except (EtnetError, KeyboardInterrupt) as error:
        viewer.stop()
        print(f"\netnet-view: {error or 'stopped'}", file=sys.stderr)
        return False
    return True


def _check(viewer: Viewer, config: ViewerConfig) -> int:
    """Try what the demo needs; 1 where something will fail."""
    from app.demo_check import check_demo

    num_bad = 0
    try:
        for finding in check_demo(viewer, config):
            print(f"{'ok  ' if finding.is_good else 'FAIL'}  {finding.name}: {finding.words}", flush=True)
            num_bad += not finding.is_good
    finally:
        viewer.stop()
    print("The demo is ready." if num_bad == 0 else f"{num_bad} will fail: see above.")
    return 1 if num_bad else 0


def _until_asked_to_end() -> threading.Event:
    """Set by Ctrl+C, SIGTERM and SIGHUP, however often they come; the process then ends within `ENDS_WITHIN`."""
    asked = threading.Event()

    def ask(number: int, frame: object) -> None:
        if not asked.is_set():
            asked.set()
            # What visitors do, and a step of the network that cannot be interrupted, hold up nothing beyond this.
            last = threading.Timer(ENDS_WITHIN, os._exit, (0,))
            last.daemon = True
            last.start()

    if threading.current_thread() is threading.main_thread():
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), ask)
    return asked


def _leave() -> None:
    """End the process without waiting for threads that compute: all that is to be tidied up is."""
    with suppress(Exception):
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):
            stream.flush()
    os._exit(0)


class Viewer:
    """A running viewer: server, engine and catalogue of one configuration."""

    def __init__(self, config: ViewerConfig, views: Sequence[Any] = (), is_embedded: bool = False) -> None:
        """`views`: more views of one's own, beside those of the configuration (see `own_views`).

        `is_embedded`: a notebook shows the page in a frame.
        """
        # Imported here so that `etnet-view --help` and a wrong argument answer at once.
        from app.catalogue.homes import Homes
        from app.catalogue.mirror import Mirrors
        from app.catalogue.uploads import UploadLimits, Uploads
        from app.session.demo import MOST_VISITORS
        from app.session.presentation import Presentation
        from app.session.ready import get_ready
        from app.views import VIEWS
        from app.views.live import VIEW as LIVE
        from app.views.own.load import own_views
        from app.web.server import Address, free_port

        sweep("etnet-")  # what a viewer that was killed has left: visitors' files, and scratch
        # A visitor who leaves while the page is drawn is nothing to tell on the terminal.
        warnings.filterwarnings("ignore", message="Queued a .* on a closed connection", category=UserWarning)
        _check_file(config.file)
        session = session_in(config)
        if session is not None:
            config = config_of(session, config)
        self._config, self.token, self.host = config, config.token, config.host
        own = own_views([*config.views, *views], config.is_open)
        self.live = open_feed(config)
        self._views = (*VIEWS, *((LIVE,) if self.live else ()), *own)
        self.catalogue = Catalogue(config, self.live, self._forget)
        self.default = default = self._first_view(config, session)
        address = Address(config.host, config.port, config.token, config.public_url, is_embedded)
        self.port = free_port(config.host, config.port)
        self._wanted_port = config.port
        self._address = address
        self.engine = self._new_engine(config, default)
        self._visits: WeakSet[Session] = WeakSet()
        megabytes = config.upload_megabytes
        limits = None if megabytes is None else UploadLimits.of_megabytes(megabytes)
        self.uploads = None if limits is None else Uploads(limits, self.catalogue.take_in, self._let_go)
        streams = self.catalogue.films.stream
        self.mirrors = Mirrors(streams, self.catalogue.take_in, self._let_go) if config.camera else None
        self.homes = Homes() if config.take_home else None
        self._presentation = Presentation() if config.follow else None
        self.server = self._serve(address, MOST_VISITORS if config.demo else None)
        self.port = self.server.get_port()
        if self.live is not None:
            self.live.start()
        THREADS.start(partial(get_ready, self._views), "getting ready")
        if default.model_id:
            THREADS.start(self.catalogue.look_at_files, "looking at files")
            self.engine.prepare(default.model_id, default.precision)  # torch is imported now, the page is up
        if default.recording_id and self.live is None:
            THREADS.start(lambda: self._open_first(default.recording_id), "opening")

    def _serve(self, address: Address, most_visitors: int | None) -> viser.ViserServer:
        """The page, for everybody who may come."""
        from app.web.index_page import IndexPage
        from app.web.server import start_server

        self._index = IndexPage(address.public_url)
        pages = self.homes.get if self.homes is not None else lambda path: None
        return start_server(address, self.port, self._visit, most_visitors, self._doors(), pages, self._index)

    def _new_engine(self, config: ViewerConfig, default: ViewState) -> Engine:
        """One engine for all visitors, with what earlier starts kept on disk."""
        from app.engine.engine import Engine
        from etnet.playback.disk_cache import DiskCache

        return Engine(
            self.catalogue,
            budget_bytes=config.budget_bytes,
            threads=config.threads,
            device=config.device,
            live=None if self.live is None else (self.live, default.model_id, default.precision),
            disk=None if config.cache_bytes is None else DiskCache(budget_bytes=config.cache_bytes),
            keeps=self._may_stay,
            tunes=True,
            longest_step=LONGEST_STEP if config.is_open else None,
        )

    @property
    def url(self) -> str:
        """What to open in a browser; with the token, where one is needed."""
        host = self._address.host if self._address.host not in ("0.0.0.0", "::") else "localhost"
        base = self._address.public_url or f"http://{f'[{host}]' if ':' in host else host}:{self.port}"
        return base.rstrip("/") + (f"/?token={quote(self._address.token, safe='')}" if self._address.token else "")

    @property
    def where_to_look(self) -> str:
        """The one line that is printed."""
        is_moved = self._wanted_port not in (0, self.port)
        busy = f" (port {self._wanted_port} is busy)" if is_moved else ""
        return f"ET-Net viewer: open {self.url}{busy} — Press Ctrl+C to stop"

    def rehearse(self, tell: Callable[[int, int], None] = lambda done, total: None) -> None:
        """Render the first recording before anybody comes; its first events then move before the page has started.

        `tell` is told (images made, images wanted). Raises EtnetError where the recording cannot be shown.
        """
        from app.catalogue.recordings import suited_policy
        from app.session.rehearsal import rehearse
        from app.views.demo.first import first_html

        view = self.default
        rehearse(self.engine, self.catalogue, view, tell, may_be_silent=True)
        if self.live is None:
            recording = self.catalogue.open(view.recording_id)
            policy = suited_policy(recording) if view.policy is None else view.policy
            self._index.begin_with(first_html(recording, policy))

    def newest_page(self) -> Page | None:
        """What was drawn last for anybody who is here; `None` before anything was."""
        drawn = [held for session in tuple(self._visits) if (held := session.drawn) is not None]
        return max(drawn, key=lambda held: held[0])[1] if drawn else None

    def stop(self) -> None:
        """End server and engine. Visitors' files go first, whatever else is slow to end."""
        self.engine.stop(patience=0.0)
        if self.mirrors is not None:
            self.mirrors.close()
        if self.uploads is not None:
            self.uploads.close()
        self.server.stop()
        self.engine.stop()
        self.catalogue.close()

    def _doors(self) -> dict[str, Handler]:
        """Websockets beside viser's: where files come in, and cameras."""
        from app.web import camera_endpoint, upload_endpoint

        doors: dict[str, Handler] = {}
        if self.uploads is not None:
            doors[upload_endpoint.PATH] = upload_endpoint.UploadEndpoint(self.uploads)
        if self.mirrors is not None:
            doors[camera_endpoint.PATH] = camera_endpoint.CameraEndpoint(self.mirrors)
        return doors

    def _visit(self, client: viser.ClientHandle) -> Session:
        """One visitor. Who sits at this machine may record a live source and change its settings, but not in public."""
        from app.catalogue.visitor import VisitorCatalogue
        from app.session.booth import Booth, MirrorNews
        from app.session.session import Session
        from app.web.peer import sits_here

        self.engine.expect()
        booth = None
        desk = None if self.uploads is None else self.uploads.desk()
        try:
            is_host = not self.default.is_public and sits_here(self._address.public_url)
            seen = VisitorCatalogue(self.catalogue, desk, is_host)
            follow = partial(self._follow_session, self._config, seen, self.default)
            mail: SimpleQueue[Item] = SimpleQueue()
            seat = None if self._presentation is None else self._presentation.join(is_host, seen.entry, mail.put)
            mirror = None if self.mirrors is None else self.mirrors.mirror(lambda begun: mail.put(MirrorNews(begun)))
            booth = Booth(mirror, self.homes, self._address.public_url or "", seat)
            session = Session(client, seen, self.engine, self.default, desk, self._views, follow, booth, mail)
        except BaseException:
            for held in (desk, booth):
                if held is not None:
                    held.close()
            raise
        self._visits.add(session)
        return session

    def _first_view(self, config: ViewerConfig, session: TakenSession | None) -> ViewState:
        """What a new page shows: the first recording by the first network, or what a session was taken of."""
        from app.session.demo import public_view

        entries, models = self.catalogue.entries(), self.catalogue.models()
        view = ViewState(
            recording_id=entries[0].id if entries else "",
            model_id=models[0].id if models else "",
            precision=config.precision,
        )
        view = replace(view, cleaning=parse_cleaning(config.filter))
        if session is not None:
            view = view_of(session, view, models)
            recording_id, opened = id_of(session, config, entries[0])
            view = replace(view, recording_id=recording_id)
            self.catalogue.grant(recording_id, opened)
        return public_view(view) if config.demo else view

    def _follow_session(
        self, config: ViewerConfig, catalogue: VisitorCatalogue, default: ViewState, recording_id: str
    ) -> ViewState | None:
        """The page of a session file that a visitor handed over; `None` for another file."""
        path = catalogue.entry(recording_id).path
        if path.suffix != SUFFIX:
            return None
        others = [entry for entry in catalogue.entries() if entry.id != recording_id]
        return handed_over(path, others, default, catalogue.models(), config)

    def _open_first(self, recording_id: str) -> None:
        """Open what the first visitor will see, while they are on their way."""
        with suppress(EtnetError):  # the visitor is told
            if not self.catalogue.is_film(self.catalogue.entry(recording_id)):
                self.catalogue.open(recording_id)

    def _may_stay(self, recording_id: str) -> bool:
        """Whether frames of a recording may stay on disk: what is a visitor's own is private, and goes with them."""
        try:
            return self.catalogue.entry(recording_id).kind in ("bundled", "data", "file", "on demand")
        except EtnetError:
            return False

    def _let_go(self, recording_id: str) -> None:
        """Forget a visitor's recording with everything that was computed of it."""
        self._forget(recording_id, self.catalogue.let_go(recording_id))

    def _forget(self, recording_id: str, recordings: Sequence[Recording] = ()) -> None:
        """Forget everything that was computed of a recording."""
        from app.html.moment import forget_recording

        self.engine.forget(recording_id, recordings)
        forget_recording(recording_id)
