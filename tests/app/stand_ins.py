"""Stand-ins for the page's tests: a catalogue and an engine in memory, and a browser that is only a websocket."""

import asyncio
import contextlib
import os
import re
import struct
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import msgspec
import numpy as np
import viser
import zstandard
from websockets.asyncio.client import connect

from app.catalogue.entries import Entry
from app.catalogue.listed_facts import ListedFacts
from app.catalogue.models import ModelEntry
from app.catalogue.recordings import CatalogueError
from app.catalogue.uploads import Uploads
from app.catalogue.videos import Videos
from app.catalogue.visitor import VisitorCatalogue
from app.engine.denoised import CleanedRecordings
from app.engine.requests import EngineStatus, Failed, Ready, Working
from app.session.booth import Booth
from app.session.session import Session
from app.state.view_state import ViewState
from app.views import VIEWS
from app.web.server import Address, free_port, start_server
from app.web.upload_endpoint import PATH, UploadEndpoint
from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.nets.runtime import Contract, Runtime

CONTRACT = Contract(Runtime(), "cpu", 1, "none", "test")
SENSOR = Sensor(40, 30)


def recording(name="moving", num_frames=31, num_events=6000, seed=0):
    rng = np.random.default_rng(seed)
    stamps = np.arange(num_frames, dtype=np.int64) * 10_000
    events = Events(
        rng.integers(0, SENSOR.width, num_events).astype(np.uint16),
        rng.integers(0, SENSOR.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, int(stamps[-1]), num_events)).astype(np.int64),
        rng.choice(np.array([-1, 1], np.int8), num_events),
        SENSOR,
    )
    frame = np.linspace(0, 1, SENSOR.num_pixels, dtype=np.float32).reshape(SENSOR.height, SENSOR.width)
    return recording_of_events(events, name, ground_truth=GroundTruth(stamps, lambda i: frame))


class Shelf:
    """Two recordings that open and one that does not."""

    live = None

    def __init__(self):
        self.recordings = {"a": recording("first"), "b": recording("second", 21, seed=1)}
        self.private = {}
        self.films = Videos()
        self.facts = ListedFacts()

    def is_film(self, entry):
        return False

    def can_be_stated(self, entry):
        return False

    def can_be_binned(self, entry):
        return False

    def take_in(self, entry):
        self.private[entry.id] = entry
        self.recordings[entry.id] = recording(entry.title, seed=2)

    def let_go(self, recording_id):
        self.private.pop(recording_id)
        self.recordings.pop(recording_id)

    def entries(self):
        return tuple(Entry(i, f"recording {i}", "data", "", Path(f"{i}.h5")) for i in ("a", "b", "broken"))

    def entry(self, recording_id):
        listed = (*self.entries(), *self.private.values())
        found = next((entry for entry in listed if entry.id == recording_id), None)
        if found is None:
            raise CatalogueError("no such recording")
        return found

    def growing(self):
        return ()

    def models(self):
        return (ModelEntry("m", "a network", "", True, (0.1, 1.0), 5, "m"),)

    def model(self, model_id):
        if model_id != "m":
            raise CatalogueError("no such model")
        return self.models()[0]

    def open(self, recording_id, progress=None):
        if recording_id not in self.recordings:
            raise RecordingError("broken.h5: the file ends at byte 12; copy it again")
        return self.recordings[recording_id]


class InstantEngine:
    """Answers at once, on a thread of its own, unless it is held; remembers what was asked."""

    def __init__(self):
        self.requests = []
        self.dropped = []
        self.jobs = []
        self.is_held = False
        self.has_frames_at_hand = False
        self.cleaned = CleanedRecordings()
        self.failure = ""

    def request(self, visitor, request, deliver):
        self.requests.append((visitor, request))
        if self.is_held:
            deliver(Working(request, 14, 19, "replaying"))
            return
        if self.has_frames_at_hand:
            self._answer(request, deliver)
            return
        threading.Thread(target=self._answer, args=(request, deliver), daemon=True).start()

    def _answer(self, request, deliver):
        if self.failure:
            deliver(Failed(request, self.failure))
            return
        frame = np.full((SENSOR.height, SENSOR.width), 0.5, np.float32)
        deliver(Ready(request, frame, None, 3.0, True, False, False, CONTRACT, request.index))

    def drop(self, visitor):
        self.dropped.append(visitor)

    def job(self, visitor, slot, job, tell):
        self.jobs.append((visitor, slot, job))
        self.tell = tell

    def drop_job(self, visitor, slot):
        self.jobs.append((visitor, slot, None))

    def cached(self, request):
        return None

    def thumbnail(self, request):
        return None

    def status(self, request):
        return EngineStatus(False, 42.0, "fp32", 0)


@dataclass
class Served:
    """A running viewer over stand-ins."""

    port: int
    engine: InstantEngine
    shelf: Shelf
    sessions: dict
    uploads: Uploads | None = None


@contextlib.contextmanager
def served(view=lambda default: default, most_visitors=None, limits=None, views=VIEWS, presentation=None):
    shelf, engine, sessions = Shelf(), InstantEngine(), {}
    default = view(ViewState(recording_id="a", model_id="m", precision="fp32"))

    uploads = None if limits is None else Uploads(limits, shelf.take_in, shelf.let_go)

    def visit(client):
        own_files = None if uploads is None else uploads.desk()
        seen = VisitorCatalogue(shelf, own_files)
        mail = SimpleQueue()
        booth = None if presentation is None else Booth(seat=presentation.join(False, seen.entry, mail.put))
        sessions[client.client_id] = Session(client, seen, engine, default, own_files, views, booth=booth, mail=mail)
        return sessions[client.client_id]

    doors = {} if uploads is None else {PATH: UploadEndpoint(uploads)}
    server = start_server(Address(), free_port("127.0.0.1", 18_600), visit, most_visitors, doors)
    try:
        yield Served(server.get_port(), engine, shelf, sessions, uploads)
    finally:
        server.stop()
        if uploads is not None:
            uploads.close()


def held_files(uploads):
    """Names of what lies in the uploads' folder, visitors' marks aside."""
    folder = uploads._folder
    if folder is None:
        return []
    # Unlike rglob, os.walk passes over a folder that is removed while it looks.
    return [name for _, _, names in os.walk(folder.path) for name in names if name != ".held"]


class Browser:
    """A page without a screen: keeps the widgets' last state and can use them as a visitor does."""

    def __init__(self, socket, tab=7):
        self._socket = socket
        self.widgets = {}
        self.types = {}
        self.storage = {}
        self.notices = []
        self.arrivals = []
        self.tab = tab

    @classmethod
    @contextlib.asynccontextmanager
    async def open(cls, port, tab=7, storage=None, aspect=1.6):
        protocol = f"viser-v{viser.__version__}"
        async with connect(
            f"ws://127.0.0.1:{port}", subprotocols=[protocol], max_size=None, compression=None
        ) as socket:
            browser = cls(socket, tab)
            browser.storage = {} if storage is None else storage
            reader = asyncio.create_task(browser._read())
            await browser._send(_camera(aspect))
            try:
                yield browser
            finally:
                reader.cancel()

    async def _send(self, message):
        await self._socket.send(msgspec.msgpack.encode(message))

    async def _read(self):
        async for raw in self._socket:
            size, packed = struct.unpack("<QQ", raw[:16])
            content = zstandard.ZstdDecompressor().decompress(raw[16 : 16 + packed], max_output_size=size)
            for message in msgspec.msgpack.decode(content)["messages"]:
                await self._hear(message)

    async def _hear(self, message):
        kind = message["type"]
        self.arrivals.append((time.monotonic(), kind, message))
        if kind.startswith("Gui") and "props" in message and "uuid" in message:
            self.widgets[message["uuid"]] = dict(message["props"], value=message.get("value"))
            self.types[message["uuid"]] = kind
            if message["props"].get("label") == "channel" and self.tab is not None:
                await self.use(message["uuid"], f"hello|{self.tab}|1600|900|1")
        elif kind == "GuiUpdateMessage" and message["uuid"] in self.widgets:
            self.widgets[message["uuid"]].update(message["updates"])
        elif kind == "NotificationShowMessage":
            self.notices.append(message["props"])
        elif kind == "LocalStorageSetItemMessage":
            self.storage[message["key"]] = message["value"]
        elif kind == "LocalStorageGetItemRequestMessage":
            await self._send(
                {
                    "type": "LocalStorageGetItemResponseMessage",
                    "value": self.storage.get(message["key"]),
                    "error": None,
                    "request_uuid": message["request_uuid"],
                }
            )

    async def use(self, uuid, value):
        await self._send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})

    async def turn(self, aspect, position):
        """A hand moves the camera."""
        await self._send(_camera(aspect, position))

    def widget(self, label):
        return next(
            uuid
            for uuid, props in self.widgets.items()
            if props.get("label") == label and self.types[uuid] != "GuiFolderMessage"
        )

    def is_open(self, title):
        """Whether the settings under this title can be seen in the inspector column."""
        return any(
            props.get("label") == title and props.get("visible", True) and self.types[uuid] == "GuiFolderMessage"
            for uuid, props in self.widgets.items()
        )

    def html(self):
        return "\n".join(str(props.get("content", "")) for props in self.widgets.values())

    def words(self):
        """What a visitor reads."""
        return re.sub(r"<[^>]+>", "", self.html())

    async def until(self, condition, patience=60.0):
        ends = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < ends, self.html()[-3000:]
            await asyncio.sleep(0.01)

    async def until_shown(self, text, patience=60.0):
        await self.until(lambda: text in self.html() or text in self.words(), patience)


def _camera(aspect, position=(0, 0, -5)):
    return {
        "type": "ViewerCameraMessage", "wxyz": [1, 0, 0, 0], "position": list(position), "fov": 1.0, "near": 0.01,
        "far": 100.0, "image_height": 900, "image_width": int(900 * aspect), "look_at": [0, 0, 0],
        "up_direction": [0, -1, 0],
    }  # fmt: skip
