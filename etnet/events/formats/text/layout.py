"""What the head of event text says: where rows begin, which column is which, how large the sensor is."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

import numpy as np

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit, said_unit
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks
from etnet.events.formats.bounds import ANY_PIXELS, declared_sensor
from etnet.events.formats.column_names import column_keys, named_axis
from etnet.events.formats.table_order import table_order
from etnet.events.formats.text.rows import Columns, plain_row

HEAD_BYTES = 1 << 18
"""Bytes that are looked at: comments of any reasonable length, and some hundreds of rows."""

SAMPLE_ROWS = 1000
"""Rows by which columns and units are judged."""

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_COMMENTS = (b"#", b"%", b"//")
_GEOMETRY = re.compile(
    rb"(?:geometry|resolution|sensor[ _]?size|width)\s*[:=]\s*(\d{1,5})\D{1,12}(\d{1,5})", re.IGNORECASE
)
_SIDE = re.compile(rb"\b(width|height)\s*[:=]\s*(\d{1,5})\s*$", re.IGNORECASE)
"""One side of the sensor alone on a line."""

_LARGEST_COLUMNS = 64


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns, the bytes and lines before the first row, the sensor if a line gives it, the names if one does."""

    columns: Columns
    num_bytes: int
    num_lines: int
    sensor: Sensor | None = None
    names: tuple[str, ...] = ()
    sample: tuple[tuple[bytes, ...], ...] = ()


def looks_like_events(head: bytes) -> bool:
    """Whether these are rows of events: four numbers each, or with names that say which are."""
    try:
        start = _start(head, "head", is_size_stated=True)  # a size that is nonsense is said on opening
    except RecordingError:
        return False
    if start is None or start.names:
        return start is not None
    return start.columns.count == 4 and (not start.sample or table_order(_numbers(start), False) is not None)


def looks_like_rows(head: bytes) -> bool:
    """Whether rows of numbers begin here; what they mean may not be known."""
    try:
        return _start(head, "head") is not None
    except RecordingError:
        return True


def text_layout(
    head: bytes, name: str, remarks: Remarks, stated: TimeUnit | None, is_size_stated: bool = False
) -> tuple[Layout, TimeUnit | None]:
    """The layout, and the unit if a person or the name of a column states it; all of it is said.

    A size in it that is nonsense is an error, unless a person states the size.
    """
    start = _start(head, name, is_size_stated)
    if start is None:
        raise RecordingError(
            f'{name}: its first lines are not "t x y p" in numbers; '
            "a table with other columns needs a header line that names them"
        )
    if start.columns.decimal_comma:
        remarks.detected("numbers have decimal commas")
    if start.names:
        return _named(start, remarks, stated)
    if start.columns.count != 4:
        raise RecordingError(
            f"{name}: rows of {start.columns.count} numbers and no line that names them; put a first line before them "
            'that does, such as "t x y p" with a word for each further column'
        )
    return _unnamed(start, name, remarks, stated)


def _named(start: Layout, remarks: Remarks, stated: TimeUnit | None) -> tuple[Layout, TimeUnit | None]:
    column = start.columns
    unit = stated
    if stated is not None:
        remarks.assumed(said_unit(stated))
    else:
        named = named_axis(start.names[column.t])
        unit = None if named is None else named[1]
        if unit is not None:
            remarks.detected(f'time unit {unit}: their column is called "{start.names[column.t]}"')
    return _counting(start, column, unit), unit


def _unnamed(start: Layout, name: str, remarks: Remarks, stated: TimeUnit | None) -> tuple[Layout, TimeUnit | None]:
    rows = _numbers(start)
    order = table_order(rows) if len(rows) else "txyp"
    assert order is not None
    if order != "txyp":
        remarks.assumed(
            f"columns are {', '.join(order)}, judged by the values of the first {len(rows)} rows; "
            "a first line that names them overrules"
        )
    if stated is not None:
        remarks.assumed(said_unit(stated))
    t, x, y, p = (order.index(axis) for axis in "txyp")
    columns = Columns(t, x, y, p, 4, "s", start.columns.decimal_comma)
    return _counting(start, columns, stated), stated


def _numbers(start: Layout) -> np.ndarray:
    return np.array([[float(token) for token in row] for row in start.sample])


def _counting(start: Layout, columns: Columns, unit: TimeUnit | None) -> Layout:
    """With the unit that the stamps are taken to count for now: fractions are seconds, whole numbers µs."""
    if unit is None:
        has_fractions = any(has_fraction(row[columns.t]) for row in start.sample)
        unit = "s" if has_fractions else "us"
    found = Columns(columns.t, columns.x, columns.y, columns.p, columns.count, unit, columns.decimal_comma)
    return Layout(found, start.num_bytes, start.num_lines, start.sensor, start.names, start.sample)


def _start(head: bytes, name: str, is_size_stated: bool = False) -> Layout | None:
    """The first row and what stands before it; None where no rows of numbers come."""
    consumed = len(BYTE_ORDER_MARK) if head.startswith(BYTE_ORDER_MARK) else 0
    sensor: Sensor | None = None
    names: tuple[str, ...] = ()
    sides: dict[bytes, bytes] = {}
    for number, line in enumerate(head[consumed:].splitlines(keepends=True), 1):
        words = line.strip()
        if not words or words.startswith(_COMMENTS):
            sensor = _declared(words, sides, name, is_size_stated) or sensor
            names = _names_in(words.lstrip(b"#%/ !")) or names
        elif not words.lower().startswith(b"sep="):  # which Excel writes and reads
            has_comma = _has_decimal_comma(words)
            row = plain_row(words, has_comma).split()
            if _are_values(row):
                if len(row) == 2 and sensor is None and not names and all(token.isdigit() for token in row):
                    sensor = _sensor(row[0], row[1], f"{name}: its first line", is_size_stated)
                elif len(row) >= 4:
                    return _layout(head, consumed, names, len(row), has_comma, sensor, name)
                else:
                    return None
            elif names:
                shown = words[:60].decode("utf-8", "replace")
                raise RecordingError(
                    f'{name}: line {number} reads "{shown}" after a line that names {", ".join(names)[:80]}; wanted '
                    "numbers there; correct or remove the line"
                )
            else:
                # Before the names, pandas has nothing for its index, and tabs divide.
                names = _names_in(line.strip(b" \r\n"))
                if not names:
                    return None
        consumed += len(line)
    return None


def _sensor(width: bytes, height: bytes, where: str, is_size_stated: bool) -> Sensor | None:
    try:
        return declared_sensor(int(width), int(height), where, ANY_PIXELS)
    except RecordingError:
        if not is_size_stated:
            raise
        return None


def _declared(comment: bytes, sides: dict[bytes, bytes], name: str, is_size_stated: bool) -> Sensor | None:
    """The sensor that a comment states; `sides` keeps one that stands on a line of its own."""
    geometry = _GEOMETRY.search(comment)
    if geometry is not None:
        return _sensor(geometry[1], geometry[2], f"{name}: its head", is_size_stated)
    side = _SIDE.search(comment)
    if side is None:
        return None
    sides[side[1].lower()] = side[2]
    if len(sides) < 2:
        return None
    return _sensor(sides[b"width"], sides[b"height"], f"{name}: its head", is_size_stated)


def _layout(
    head: bytes, consumed: int, names: tuple[str, ...], count: int, has_comma: bool, sensor: Sensor | None, name: str
) -> Layout | None:
    if count > _LARGEST_COLUMNS:
        return None
    lines = head[consumed:].splitlines()
    if len(lines) > 1 and not head.endswith(b"\n"):
        lines.pop()  # it may be cut
    split = (tuple(plain_row(line, has_comma).split()) for line in lines[:SAMPLE_ROWS])
    sample = tuple(row for row in split if len(row) == count and _are_values(list(row)))
    places = {"t": 0, "x": 1, "y": 2, "p": 3}
    if names:
        if len(names) != count:
            raise RecordingError(
                f"{name}: a line names {len(names)} columns ({', '.join(names)[:80]}) and the first row has {count}; "
                "correct the line"
            )
        keys = column_keys(names) or {}
        places = {axis: names.index(keys[axis]) for axis in "txyp"}
    columns = Columns(places["t"], places["x"], places["y"], places["p"], count, "s", has_comma)
    return Layout(columns, consumed, head[:consumed].count(b"\n"), sensor, names, sample)


def _names_in(line: bytes) -> tuple[str, ...]:
    """The names in a line, split at its own delimiter; none where they are not those of x, y, t and p."""
    text = _decoded(line)
    mark = next((mark for mark in ",;\t" if mark in text), None)
    # A unit in brackets belongs to the word before it, whatever stands between.
    parts = text.split(mark) if mark else re.split(r"\s+(?![\[(])", text.strip())
    names = tuple(part.strip().strip("\"'") for part in parts)
    if mark and not names[-1]:
        names = names[:-1]  # a delimiter after the last one, too
    keys = column_keys(names) if 4 <= len(names) <= _LARGEST_COLUMNS else None
    return names if keys is not None and "xy" not in keys else ()


def _decoded(line: bytes) -> str:
    """As UTF-8, else as Windows writes it: a µ must not get lost before an s."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace")


def _has_decimal_comma(line: bytes) -> bool:
    """Whether commas stand in numbers, because semicolons or tabs stand between them."""
    return re.match(rb"^[^;\t]*\d,\d[^;\t]*[;\t]", line) is not None


def _are_values(row: list[bytes]) -> bool:
    """Whether numbers stand where four are due; words may stand in further columns."""
    return len(row) >= 2 and sum(_number(token) is not None for token in row) >= min(4, len(row))


def _number(token: bytes) -> Decimal | None:
    try:
        value = Decimal(token.decode("ascii"))
    except (InvalidOperation, ValueError):
        return None
    return value if value.is_finite() and abs(value.adjusted()) < 400 else None


def has_fraction(token: bytes) -> bool:
    """Whether it is no whole number; of "5.0", too, not of "1e+06" or "1.5e+01", in which any number may be printed."""
    value = _number(token)
    if value is None:
        return False
    return value != value.to_integral_value() or (b"." in token and b"e" not in token.lower())
