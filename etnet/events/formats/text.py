"""Events as lines of text: RPG and E2VID ("t x y p"), alone, zipped, or as a folder with the camera's pictures.

Layouts: the Event-Camera Dataset's folder (events.txt, images.txt, images/; rpg.ifi.uzh.ch/davis_data) and
rpg_e2vid's zip, whose first line is "width height".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from io import BufferedIOBase

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.collect import Decoded, collect
from etnet.events.formats.pictures import picture_list
from etnet.events.formats.rows import Columns, parse_rows
from etnet.events.formats.store import FolderStore, Store, ZipStore

BLOCK = 1 << 19
"""Bytes parsed at once: small enough for a processor's cache."""

LONGEST_LINE = 4096


def looks_like_events(head: bytes) -> bool:
    """Whether the first line with numbers holds "t x y p", perhaps after "width height"."""
    try:
        _, columns, _ = _preamble(head, "head", Remarks(), None)
    except RecordingError:
        return False
    return columns is not None


def text_pieces(stream: BufferedIOBase, size: int, columns: Columns, name: str, first_line: int) -> Iterator[Decoded]:
    """Parse the rest of a stream, whole lines at a time."""
    rest, done, line = b"", 0, first_line
    while block := stream.read(BLOCK):
        done += len(block)
        cut = block.rfind(b"\n") + 1
        if cut == 0:
            rest += block
            if len(rest) > BLOCK + LONGEST_LINE:
                raise RecordingError(f"{name}: line {line} is longer than {LONGEST_LINE} bytes; this is no event text")
            continue
        whole, rest = b"".join((rest, memoryview(block)[:cut])), block[cut:]
        rows = parse_rows(whole, columns, name, line)
        line += rows.num_lines
        yield Decoded(rows.x, rows.y, rows.t, rows.p, done / max(size, done))
    if rest.strip():
        rows = parse_rows(rest, columns, name, line)
        yield Decoded(rows.x, rows.y, rows.t, rows.p, 1.0)


def _preamble(
    head: bytes, name: str, remarks: Remarks, stated: TimeUnit | None
) -> tuple[Sensor | None, Columns | None, int]:
    """Sensor, columns, and the number of bytes before the first row. `Columns` is None when these are no events."""
    sensor, consumed = None, 0
    for line in head.splitlines(keepends=True):
        tokens = line.replace(b",", b" ").split()
        if not tokens or tokens[0].startswith(b"#"):
            consumed += len(line)
            continue
        if not all(_is_number(token) for token in tokens):
            return None, None, 0
        if len(tokens) == 2 and sensor is None and all(token.isdigit() for token in tokens):
            width, height = int(tokens[0]), int(tokens[1])
            if not (0 < width <= 65_536 and 0 < height <= 65_536):
                raise RecordingError(
                    f"{name}: its first line gives the sensor {width} × {height}; sides are 1 … 65,536"
                )
            sensor, consumed = Sensor(width, height), consumed + len(line)
            continue
        if len(tokens) != 4:
            return None, None, 0
        return sensor, Columns(0, 1, 2, 3, 4, _unit(tokens[0], remarks, stated)), consumed
    return None, None, 0


def _unit(first_stamp: bytes, remarks: Remarks, stated: TimeUnit | None) -> TimeUnit:
    if stated is not None:
        remarks.assumed(f"stamps count {stated}, as stated")
        return stated
    if b"." in first_stamp or b"e" in first_stamp.lower():
        return "s"
    unit: TimeUnit = "ns" if len(first_stamp) > 17 else "us"
    remarks.assumed(f"stamps count {unit}, because the first one is a whole number; --time-unit overrules")
    return unit


def _is_number(token: bytes) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True


def _event_member(names: tuple[str, ...]) -> str | None:
    """The one text file with events in a folder or archive."""
    named = [name for name in names if name.rsplit("/", 1)[-1] == "events.txt"]
    if len(named) == 1:
        return named[0]
    texts = [name for name in names if name.lower().endswith((".txt", ".csv"))]
    return texts[0] if len(texts) == 1 else None


def _open_stream(
    request: Request,
    opener: Callable[[], BufferedIOBase],
    size: int,
    kind: str,
    store: Store | None,
    member: str | None,
) -> Opened:
    remarks = Remarks()
    stream = request.resources.enter_context(opener())
    head = stream.read(4096)
    stream.close()
    declared, columns, skipped = _preamble(head, request.name, remarks, request.assume.time_unit)
    if columns is None:
        raise RecordingError(
            f'{request.name}: its first lines are not "t x y p" in numbers; '
            "a table with other columns needs a header line that names them"
        )
    pictures = None
    if store is not None and member is not None:
        pictures = picture_list(store, member, request.name, remarks, request.assume.time_unit)
    if declared is None and pictures is not None and len(pictures) and request.assume.sensor is None:
        height, width = pictures.read_frame(0).shape
        declared = Sensor(width, height)
        remarks.detected(f"sensor {declared}, the size of the pictures")
    with opener() as stream:
        lines = head[:skipped].count(b"\n")
        stream.read(skipped)
        pieces = text_pieces(stream, size, columns, request.name, 1 + lines)
        collected = collect(request, pieces, declared, remarks)
    return Opened(kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept), pictures)


def _open_file(request: Request) -> Opened:
    size = request.path.stat().st_size
    return _open_stream(request, lambda: request.path.open("rb"), size, "RPG text", None, None)


def _open_store(request: Request) -> Opened:
    store: Store = FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, request.resources)
    member = _event_member(request.members)
    if member is None:
        raise RecordingError(f"{request.name}: holds no single text file with events")
    kind = "RPG text folder" if request.path.is_dir() else "RPG or E2VID zip"
    return _open_stream(request, lambda: store.open(member), store.size(member), kind, store, member)


def _is_store(request: Request) -> bool:
    return bool(request.members) and _event_member(request.members) is not None


TEXT = Format("RPG text", (".txt",), lambda request: looks_like_events(request.head), _open_file)
TEXT_STORE = Format("RPG text folder or E2VID zip", (".zip", ""), _is_store, _open_store)
