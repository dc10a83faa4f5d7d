"""Rows of numbers in text: four named columns out of lines such as "0.003811000 96 133 0", fast when they are regular.

The fast way takes blocks in which every row has the same tokens with one separator between them; its one pass over the
bytes finds separators and decimal points and proves at once that all the rest are digits. Any other block goes line by
line through `decimal`, which is slow and forgives more. Both give the same numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal, InvalidOperation

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.decimals import LONGEST_FRACTION, LONGEST_WHOLE, MARGIN, Padded, microseconds, whole_numbers

_TO_SPACES = bytes.maketrans(b",;\t", b"   ")
_SCALES = {"s": Decimal(10**6), "ms": Decimal(10**3), "us": Decimal(1), "ns": Decimal(1) / 1000}


@dataclass(frozen=True, slots=True)
class Columns:
    """Which of a line's tokens are t, x, y and p, how many tokens a line has, and the unit of t."""

    t: int
    x: int
    y: int
    p: int
    count: int = 4
    unit: str = "s"


@dataclass(frozen=True, slots=True)
class Rows:
    """The four columns as numbers: t in µs, p as it stands in the file; and how many lines they took."""

    x: Int64[np.ndarray, " n"]
    y: Int64[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Int64[np.ndarray, " n"]
    num_lines: int


def parse_rows(block: bytes, columns: Columns, name: str, first_line: int) -> Rows:
    """`block` is whole lines; `first_line` is the number of its first one, for errors."""
    if not block.endswith(b"\n"):
        block += b"\n"
    if any(mark in block for mark in (b",", b";", b"\t")):
        block = block.translate(_TO_SPACES)
    if b"\r" in block:
        block = block.replace(b"\r\n", b"\n")
    if b"-" in block and columns.p == columns.count - 1:
        signed = block.replace(b" -1\n", b" 2\n")
        rows = _regular(signed, columns)
        if rows is not None:
            rows.p[rows.p == 2] = -1
    else:
        rows = _regular(block, columns)
    return rows if rows is not None else _one_by_one(block, columns, name, first_line)


def _regular(block: bytes, columns: Columns) -> Rows | None:
    """The fast way; None when the block is not regular enough for it."""
    text = Padded.of(block)
    octets = text.octets[MARGIN:-MARGIN]
    if int(octets.max()) > ord("9"):
        return None
    has_point = b"." in block[: block.index(b"\n")]
    marks = np.flatnonzero(octets < ord("0"))
    marks += MARGIN
    num_rows, left_over = divmod(len(marks), columns.count + has_point)
    if left_over or num_rows == 0:
        return None
    ends = np.ascontiguousarray(marks.reshape(num_rows, -1).T)
    points = ends[columns.t] if has_point else None
    stops = [ends[i + (has_point and i >= columns.t)] for i in range(columns.count)]
    if not _is_regular(text, stops, points):
        return None
    first = np.empty(num_rows, np.int64)
    first[0] = MARGIN
    first[1:] = stops[-1][:-1] + 1
    starts = [first, *(stop + 1 for stop in stops[:-1])]
    lengths = [stop - start for start, stop in zip(starts, stops, strict=True)]
    if any(int(length.min()) < 1 for length in lengths):
        return None
    if max(int(lengths[i].max()) for i in (columns.x, columns.y, columns.p)) > LONGEST_WHOLE:
        return None
    t = _stamps(text, starts[columns.t], points, stops[columns.t], columns.unit)
    if t is None:
        return None
    x, y, p = (whole_numbers(text, stops[i], lengths[i]) for i in (columns.x, columns.y, columns.p))
    return Rows(x, y, t, p, num_rows)


def _is_regular(text: Padded, stops: list[Int64[np.ndarray, " n"]], points: Int64[np.ndarray, " n"] | None) -> bool:
    """Whether each token ends in a blank, each row in a line feed, and each point is a point."""
    marks = [(stop, b" ") for stop in stops[:-1]] + [(stops[-1], b"\n")]
    if points is not None:
        marks.append((points, b"."))
    return all(bool((text.octets.take(places) == mark[0]).all()) for places, mark in marks)


def _stamps(
    text: Padded,
    starts: Int64[np.ndarray, " n"],
    points: Int64[np.ndarray, " n"] | None,
    stops: Int64[np.ndarray, " n"],
    unit: str,
) -> Int64[np.ndarray, " n"] | None:
    if points is None:
        longest = int((stops - starts).max())
        if unit not in ("us", "ns") or longest > LONGEST_WHOLE:
            return None
        whole = whole_numbers(text, stops, stops - starts)
        return whole if unit == "us" else from_nanoseconds(whole)
    if unit != "s" or int((stops - points).max()) > LONGEST_FRACTION + 1:
        return None
    if int((points - starts).min()) < 1 or int((points - starts).max()) > 12:
        return None
    return microseconds(text, starts, points, stops)


def _one_by_one(block: bytes, columns: Columns, name: str, first_line: int) -> Rows:
    """The patient way: any number that `decimal` reads, any run of blanks, empty lines and # comments skipped."""
    kept: list[tuple[int, int, int, int]] = []
    scale = _SCALES[columns.unit]
    for number, line in enumerate(block.split(b"\n"), first_line):
        tokens = line.split()
        if not tokens or tokens[0].startswith(b"#"):
            continue
        try:
            if len(tokens) != columns.count:
                raise ValueError(f"{len(tokens)} columns")
            values = [Decimal(tokens[i].decode("ascii")) for i in (columns.x, columns.y, columns.t, columns.p)]
            stamp = int((values[2] * scale).to_integral_value(ROUND_HALF_EVEN))
            x, y, p = (_whole(values[i]) for i in (0, 1, 3))
            if max(abs(x), abs(y), abs(p)) >= 2**31 or abs(stamp) >= 2**62:
                raise ValueError("a number beyond 64 bits")
            kept.append((x, y, stamp, p))
        except (ValueError, InvalidOperation, OverflowError) as slip:
            shown = line[:60].decode("ascii", "replace")
            raise RecordingError(
                f'{name}: line {number} reads "{shown}"; wanted {columns.count} numbers '
                f"(time, x, y and polarity among them); correct or remove the line"
            ) from slip
    table = np.array(kept, np.int64).reshape(-1, 4)
    x, y, t, p = (table[:, i].copy() for i in range(4))
    return Rows(x, y, t, p, block.count(b"\n"))


def _whole(value: Decimal) -> int:
    if value != value.to_integral_value():
        raise ValueError("a fraction where a whole number is due")
    return int(value)
