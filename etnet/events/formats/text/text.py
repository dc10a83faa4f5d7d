"""Events as lines of text: RPG, E2VID ("t x y p") and CSV, alone, zipped, or as a folder with the camera's pictures.

Layouts: the Event-Camera Dataset's folder (events.txt, images.txt, images/; rpg.ifi.uzh.ch/davis_data) and
rpg_e2vid's zip, whose first line is "width height".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from io import BufferedIOBase
from typing import Any

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.formats.archive import FolderStore, Store, ZipStore
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.declared_size import unless_stated
from etnet.events.formats.decode import collect
from etnet.events.formats.frames import Frames, attached, found_frames
from etnet.events.formats.metadata import metadata_of, metadata_size
from etnet.events.formats.picture_lists import pictures_beside
from etnet.events.formats.text.layout import HEAD_BYTES, looks_like_events, looks_like_rows, text_layout
from etnet.events.formats.text.rows import text_pieces
from etnet.events.formats.time_unit import Evidence, judged_unit
from etnet.events.provenance import provenance_of

_SHORT_HEAD = 4096
_MOST_TEXTS = 20
"""Texts of a folder that are looked into for the one with the events."""


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
    tables = [name for name in texts if looks_like_events(_head(store, name))]
    return tables[0] if len(tables) == 1 else None


def _head(store: Store, member: str) -> bytes:
    with store.open(member) as stream:
        return _head_of(stream)


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
        head = stream.read(HEAD_BYTES)
    is_stated = request.assume.sensor is not None
    layout, unit = text_layout(head, request.name, remarks, request.assume.time_unit, is_stated)
    frames, metadata = (None, {}) if store is None or member is None else _beside(request, store, member, remarks)
    declared = layout.sensor or unless_stated(request, lambda: metadata_size(metadata, request.name))
    with opener() as stream:
        stream.read(layout.num_bytes)
        columns = replace(layout.columns, rounds=request.assume.pixels == "rounded")
        if unit == "ns":
            # As they stand, for a clock of 32 bits may wrap; they are divided when all are there.
            columns = replace(columns, unit="us")
        pieces = text_pieces(stream, size, columns, request.name, 1 + layout.num_lines)
        size_of_frames = None if frames is None else frames.size
        kind = kinds[0] if layout.names else kinds[1]
        judge = _judge(unit, request, remarks)
        collected = collect(request, pieces, declared, remarks, judge, columns.unit, size_of_frames)
    truth = attached(frames, collected.span, request.assume.time_unit, request.name, remarks)
    opened = Opened(kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)
    return replace(opened, provenance=provenance_of(metadata))


def _beside(request: Request, store: Store, member: str, remarks: Remarks) -> tuple[Frames | None, Mapping[str, Any]]:
    """The pictures beside a text of events, and what a metadata.json there says."""
    folder = member.rpartition("/")[0]
    prefix, most, name = folder + "/" if folder else "", request.assume.max_pixels, request.name
    frames = found_frames(lambda: pictures_beside(store, prefix, name, remarks, most), name, remarks)
    with contained(name, "its metadata.json"):
        metadata = metadata_of(store, prefix, name)
    white = metadata.get("white")
    if frames is not None and white in (255, 65_535):
        frames = replace(frames, white=float(white))
    return frames, metadata


def _judge(unit: TimeUnit | None, request: Request, remarks: Remarks) -> Callable[[Evidence], TimeUnit] | None:
    """What tells the unit once all stamps are read; None where they are µs by then."""
    if unit is None:
        return lambda seen: judged_unit(seen, request.assume, remarks)
    return (lambda _: unit) if unit == "ns" else None


def _head_of(stream: BufferedIOBase) -> bytes:
    """Some rows; more where comments fill them."""
    head = stream.read(_SHORT_HEAD)
    is_comment = all(line.lstrip()[:1] in (b"#", b"%", b"/", b"") for line in head.splitlines())
    return head + stream.read(HEAD_BYTES - len(head)) if is_comment and len(head) == _SHORT_HEAD else head


def _head_in(request: Request) -> bytes:
    """Of the request's file; nothing of one that does not begin like text."""
    if not request.head or b"\0" in request.head:
        return b""
    with request.path.open("rb") as stream:
        return _head_of(stream)


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


def _is_text(request: Request) -> bool:
    return not request.path.is_dir() and looks_like_rows(_head_in(request))


def holds_events(request: Request) -> bool:
    """Whether rows of events are in a text."""
    return looks_like_events(_head_in(request))


TEXT = Format("RPG text or CSV", (".txt", ".csv"), _is_text, _open_file, holds_events=holds_events)
TEXT_STORE = Format("RPG text folder or E2VID zip", (".zip", ""), _is_store, _open_store)
