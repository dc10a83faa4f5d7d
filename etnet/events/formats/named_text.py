"""CSV and text whose first line names the columns, in any order, with any further columns."""

from __future__ import annotations

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.collect import collect
from etnet.events.formats.column_names import NAMES
from etnet.events.formats.rows import Columns
from etnet.events.formats.text import text_pieces

_UNITS: tuple[tuple[str, TimeUnit], ...] = (
    ("us", "us"),
    ("µs", "us"),
    ("micro", "us"),
    ("ns", "ns"),
    ("nano", "ns"),
    ("ms", "ms"),
    ("milli", "ms"),
    ("sec", "s"),
)


def _header(head: bytes) -> tuple[list[str], int] | None:
    """The names in the first line, which may be a comment, and the bytes up to the first row."""
    line, newline, _ = head.partition(b"\n")
    names = line.lstrip(b"#% \xef\xbb\xbf").decode("utf-8", "replace").lower()
    for mark in ",;\t":
        names = names.replace(mark, " ")
    tokens = [token.strip('"\r') for token in names.split()]
    if not newline or len(tokens) < 4 or _places(tokens) is None:
        return None
    return tokens, len(line) + 1


def _places(tokens: list[str]) -> dict[str, int] | None:
    plain = [token.split("(")[0].split("[")[0] for token in tokens]
    stems = [_without_unit(token) for token in plain]
    places = {}
    for axis, names in NAMES.items():
        fitting = [
            i for i, (token, stem) in enumerate(zip(plain, stems, strict=True)) if token in names or stem in names
        ]
        if len(fitting) != 1:
            return None
        places[axis] = fitting[0]
    return places


def _without_unit(token: str) -> str:
    for ending in ("_us", "_ns", "_ms", "_s", "_µs"):
        if token.endswith(ending):
            return token.removesuffix(ending)
    return token


def _named_unit(token: str) -> TimeUnit | None:
    tail = token.replace("timestamp", "")
    if tail.endswith(("_s", "(s)", "[s]")):
        return "s"
    return next((unit for mark, unit in _UNITS if mark in tail), None)


def _open(request: Request) -> Opened:
    remarks = Remarks()
    header = _header(request.head)
    if header is None:
        raise RecordingError(f"{request.name}: its first line does not name x, y, t and p")
    tokens, skipped = header
    places = _places(tokens) or {}
    unit = _unit_of(tokens[places["t"]], request, skipped, places["t"], remarks)
    columns = Columns(places["t"], places["x"], places["y"], places["p"], len(tokens), unit)
    size = request.path.stat().st_size
    with request.path.open("rb") as stream:
        stream.read(skipped)
        collected = collect(request, text_pieces(stream, size, columns, request.name, 2), None, remarks)
    return Opened("CSV", collected.source, collected.sensor, collected.span, tuple(remarks.kept))


def _unit_of(name: str, request: Request, skipped: int, place: int, remarks: Remarks) -> TimeUnit:
    if request.assume.time_unit is not None:
        remarks.assumed(f"stamps count {request.assume.time_unit}, as stated")
        return request.assume.time_unit
    named = _named_unit(name)
    if named is not None:
        remarks.detected(f'stamps count {named}: their column is called "{name}"')
        return named
    row = request.head[skipped:].split(b"\n", 1)[0]
    tokens = row.translate(bytes.maketrans(b",;\t", b"   ")).split()
    first = tokens[place] if place < len(tokens) else b""
    unit: TimeUnit = "s" if b"." in first or b"e" in first.lower() else "ns" if len(first) > 17 else "us"
    remarks.assumed(f'stamps count {unit}, judged by the first one, "{first.decode("ascii", "replace")}"')
    return unit


NAMED_TEXT = Format("CSV", (".csv", ".txt"), lambda request: _header(request.head) is not None, _open)
