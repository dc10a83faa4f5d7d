"""What the first lines of event text say without names: where rows begin, which column is which, what stamps count."""

from __future__ import annotations

from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import pairwise

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit, said_unit
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks
from etnet.events.formats.text.rows import Columns

SAMPLE_BYTES = 16 << 10
"""Some hundreds of lines, by which columns and units are judged."""

BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_TO_SPACES = bytes.maketrans(b",;\t", b"   ")
_NANOSECONDS = 10**17
"""As µs it would be the year 5138."""

_POLARITIES = ({0, 1}, {-1, 1})

Rows = list[list[bytes]]


@dataclass(frozen=True, slots=True)
class Layout:
    """The columns, the bytes and lines before the first row, and the sensor if a line gives it."""

    columns: Columns
    num_bytes: int
    num_lines: int
    sensor: Sensor | None = None


def tokens_of(line: bytes) -> list[bytes]:
    """The numbers of a line, whatever stands between them."""
    return line.translate(_TO_SPACES).split()


def sampled_rows(head: bytes, count: int) -> Rows:
    """The whole lines of `count` tokens; the last line of a head may be cut."""
    lines = head.splitlines()
    if len(lines) > 1 and not head.endswith(b"\n"):
        lines.pop()
    return [row for row in map(tokens_of, lines) if len(row) == count]


def plain_layout(head: bytes, name: str, remarks: Remarks, stated: TimeUnit | None) -> Layout | None:
    """Rows of four numbers, perhaps after comments and "width height". None when these are no events."""
    start = _first_row(head, name)
    if start is None:
        return None
    rows = [row for row in sampled_rows(head[start.num_bytes :], 4) if _are_numbers(row)]
    columns = _order(rows, remarks)
    unit = judged_unit([row[columns.t] for row in rows], remarks, stated)
    return replace(start, columns=replace(columns, unit=unit))


def judged_unit(stamps: list[bytes], remarks: Remarks, stated: TimeUnit | None) -> TimeUnit:
    """The unit that nothing names, by the first stamps; one alone may be a 0 of seconds or of µs."""
    if stated is not None:
        remarks.assumed(said_unit(stated))
        return stated
    unit: TimeUnit = "us"
    if any(_has_fraction(stamp) for stamp in stamps):
        unit, why = "s", f"there are fractions among the first {len(stamps)}"
    else:
        why = f"the first {len(stamps)} are whole numbers"
        if any((_number(stamp) or Decimal(0)).copy_abs() >= _NANOSECONDS for stamp in stamps[:1]):
            unit, why = "ns", "they are whole numbers beyond 10¹⁷"
    remarks.assumed(f"stamps count {unit}, because {why}; --time-unit overrules")
    return unit


def _first_row(head: bytes, name: str) -> Layout | None:
    """Where the first row of four numbers is, with the columns as RPG has them."""
    sensor, consumed = None, len(BYTE_ORDER_MARK) if head.startswith(BYTE_ORDER_MARK) else 0
    for line in head[consumed:].splitlines(keepends=True):
        tokens = tokens_of(line)
        if not tokens or tokens[0].startswith(b"#"):
            consumed += len(line)
        elif not _are_numbers(tokens):
            return None
        elif len(tokens) == 2 and sensor is None and all(token.isdigit() for token in tokens):
            sensor, consumed = _stated_sensor(tokens, name), consumed + len(line)
        elif len(tokens) == 4:
            return Layout(Columns(0, 1, 2, 3), consumed, head[:consumed].count(b"\n"), sensor)
        else:
            return None
    return None


def _stated_sensor(tokens: list[bytes], name: str) -> Sensor:
    width, height = int(tokens[0]), int(tokens[1])
    if not (0 < width <= 65_536 and 0 < height <= 65_536):
        raise RecordingError(f"{name}: its first line gives the sensor {width} × {height}; sides are 1 … 65,536")
    return Sensor(width, height)


def _order(rows: Rows, remarks: Remarks) -> Columns:
    """RPG's t x y p, unless what the columns hold is x y p t (Metavision's CSV) or x y t p."""
    if not rows:
        return Columns(0, 1, 2, 3)
    first, _, third, fourth = ([float(row[place]) for row in rows] for place in range(4))
    if _is_polarity(third) and _is_time(fourth):
        found, names, why = Columns(3, 0, 1, 2), "x, y, p, t", "the third holds ON and OFF, the fourth grows"
    elif _is_polarity(fourth) and _is_time(third) and _is_ordered(third) and _are_pixels(first):
        found, names, why = Columns(2, 0, 1, 3), "x, y, t, p", "the third never falls, the first does"
    else:
        return Columns(0, 1, 2, 3)
    remarks.assumed(f"columns are {names}: {why}; a first line that names them overrules")
    return found


def _is_polarity(values: list[float]) -> bool:
    return any(set(values) <= codes for codes in _POLARITIES)


def _is_time(values: list[float]) -> bool:
    """Growing, and more than a polarity of 0/2 or 0/255 could be."""
    return values[-1] >= values[0] and (len(set(values)) > 2 or max(values) > 255)


def _is_ordered(values: list[float]) -> bool:
    return all(after >= before for before, after in pairwise(values))


def _are_pixels(values: list[float]) -> bool:
    """In no order, which stamps would be in."""
    return not _is_ordered(values) and all(value.is_integer() and 0 <= value < 65_536 for value in values)


def _are_numbers(tokens: list[bytes]) -> bool:
    return all(_number(token) is not None for token in tokens)


def _number(token: bytes) -> Decimal | None:
    try:
        value = Decimal(token.decode("ascii"))
    except (InvalidOperation, ValueError):
        return None
    return value if value.is_finite() else None


def _has_fraction(token: bytes) -> bool:
    """Also of "5.0", but not of "1e+06" or "1.5e+01", in which any number may be printed."""
    value = _number(token)
    if value is None:
        return False
    return value != value.to_integral_value() or (b"." in token and b"e" not in token.lower())
