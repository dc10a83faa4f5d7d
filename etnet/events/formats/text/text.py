"""Events as lines of text: RPG, E2VID ("t x y p") and CSV, alone, zipped, or as a folder with the camera's pictures.

Layouts: the Event-Camera Dataset's folder (events.txt, images.txt, images/; rpg.ifi.uzh.ch/davis_data) and
rpg_e2vid's zip, whose first line is "width height".
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from io import BufferedIOBase

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore, Store, ZipStore
from etnet.events.formats.base import HEAD_BYTES, Format, Opened, Remarks, Request
from etnet.events.formats.camera_frames import picture_list
from etnet.events.formats.decode import collect
from etnet.events.formats.text.layout import SAMPLE_BYTES, plain_layout
from etnet.events.formats.text.named import named_layout, names_columns
from etnet.events.formats.text.rows import text_pieces

_MOST_TEXTS = 20
"""Texts of a folder that are looked into for the one with the events."""


def _holds_events(head: bytes) -> bool:
    """Whether the first lines are a table of events, with named columns or without."""
    return names_columns(head) or _is_plain(head)


def _is_plain(head: bytes) -> bool:
    try:
        return plain_layout(head, "head", Remarks(), None) is not None
    except RecordingError:
        return False


def _event_member(store: Store, names: tuple[str, ...]) -> str | None:
    """The one text file with events in a folder or archive."""
    named = [name for name in names if name.rsplit("/", 1)[-1] == "events.txt"]
    if len(named) == 1:
        return named[0]
    texts = [name for name in names if name.lower().endswith((".txt", ".csv"))]
    if len(texts) == len(names) == 1:
        return texts[0]  # whatever is in it: its own error says more than that of an unknown format
    if len(texts) > _MOST_TEXTS:
        return None
    tables = [name for name in texts if _holds_events(_head(store, name))]
    return tables[0] if len(tables) == 1 else None


def _head(store: Store, member: str) -> bytes:
    with store.open(member) as stream:
        return stream.read(HEAD_BYTES)


def _open_stream(
    request: Request,
    opener: Callable[[], BufferedIOBase],
    size: int,
    kinds: tuple[str, str],
    store: Store | None,
    member: str | None,
) -> Opened:
    """`kinds`: what it is called where a line names the columns, and where none does."""
    remarks = Remarks()
    with opener() as stream:
        head = stream.read(SAMPLE_BYTES)
    stated = request.assume.time_unit
    named = named_layout(head, remarks, stated)
    layout = named or plain_layout(head, request.name, remarks, stated)
    if layout is None:
        raise RecordingError(
            f'{request.name}: its first lines are not "t x y p" in numbers; '
            "a table with other columns needs a header line that names them"
        )
    declared, pictures = layout.sensor, None
    if store is not None and member is not None:
        pictures = picture_list(store, member, request.name, remarks, stated)
    if declared is None and pictures is not None and len(pictures) and request.assume.sensor is None:
        height, width = pictures.read_frame(0).shape
        declared = Sensor(width, height)
        remarks.detected(f"sensor {declared}, the size of the pictures")
    with opener() as stream:
        stream.read(layout.num_bytes)
        pieces = text_pieces(stream, size, layout.columns, request.name, 1 + layout.num_lines)
        collected = collect(request, pieces, declared, remarks)
    kind = kinds[0] if named is not None else kinds[1]
    return Opened(kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept), pictures)


def _open_file(request: Request) -> Opened:
    size = request.path.stat().st_size
    return _open_stream(request, lambda: request.path.open("rb"), size, ("CSV", "RPG text"), None, None)


def _open_store(request: Request) -> Opened:
    store = _store(request, request.resources)
    member = _event_member(store, request.members)
    if member is None:
        raise RecordingError(f"{request.name}: holds no single text file with events")
    kinds = ("CSV folder", "RPG text folder") if request.path.is_dir() else ("CSV in zip", "RPG or E2VID zip")
    return _open_stream(request, lambda: store.open(member), store.size(member), kinds, store, member)


def _store(request: Request, resources: ExitStack) -> Store:
    return FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, resources)


def _is_store(request: Request) -> bool:
    if not any(name.lower().endswith((".txt", ".csv")) for name in request.members):
        return False
    with ExitStack() as briefly:
        return _event_member(_store(request, briefly), request.members) is not None


NAMED_TEXT = Format("CSV", (".csv", ".txt"), lambda request: names_columns(request.head), _open_file)
TEXT = Format("RPG text", (".txt",), lambda request: _is_plain(request.head), _open_file)
TEXT_STORE = Format("RPG text folder or E2VID zip", (".zip", ""), _is_store, _open_store)
