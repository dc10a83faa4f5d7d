"""Rows of numbers in text: four named columns out of lines such as "0.003811000 96 133 0", fast when they are regular.

The fast way takes blocks in which every row has the same tokens with one separator between them; its one pass over the
bytes finds separators and decimal points and proves at once that all the rest are digits. Any other block goes line by
line through `decimal`, which is slow and forgives more. Both give the same numbers.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from decimal import ROUND_HALF_EVEN, Decimal, InvalidOperation
from io import BufferedIOBase

import numpy as np
from jaxtyping import Int64, Integer

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.formats.columns import from_nanoseconds
from etnet.events.formats.decode import Decoded
from etnet.events.formats.text.decimals import (
    LONGEST_FRACTION,
    LONGEST_WHOLE,
    MARGIN,
    Padded,
    microseconds,
    whole_numbers,
)

BLOCK = 1 << 19
"""Bytes parsed at once: small enough for a processor's cache."""

LONGEST_LINE = 4096

_MOST_DIGITS = 27
"""Before the point: 2⁶² µs in ns have 22. To write out 10⁹⁹⁹⁹⁹⁹ as a whole number takes minutes."""

_TO_SPACES = bytes.maketrans(b",;\t", b"   ")
_COMMAS_TO_POINTS = bytes.maketrans(b",;\t", b".  ")
_WORDS = re.compile(rb"(?<!\S)(?:true|false|on|off)(?!\S)", re.IGNORECASE)
_SCALES = {"s": Decimal(10**6), "ms": Decimal(10**3), "us": Decimal(1), "ns": Decimal(1) / 1000}


@dataclass(frozen=True, slots=True)
class Columns:
    """Which of a line's tokens are t, x, y and p, how many tokens a line has, and the unit of t."""

    t: int
    x: int
    y: int
    p: int
    count: int = 4
    unit: TimeUnit = "s"
    decimal_comma: bool = False
    rounds: bool = False
    """Whether fractions of pixels are rounded; else they are an error."""


@dataclass(frozen=True, slots=True)
class Rows:
    """The four columns as numbers: t in µs, p as it stands in the file; and how many lines they took."""

    x: Integer[np.ndarray, " n"]
    y: Integer[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Integer[np.ndarray, " n"]
    num_lines: int


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


def parse_rows(block: bytes, columns: Columns, name: str, first_line: int) -> Rows:
    """`block` is whole lines; `first_line` is the number of its first one, for errors."""
    if not block.endswith(b"\n"):
        block += b"\n"
    stored, block = block, _divided_by_blanks(block, columns.decimal_comma)
    rows = _fast(block, columns)
    if rows is None:
        block = _without_words(block)
        # Whole numbers may be printed as floats.
        rows = _fast(block.replace(b".0 ", b" ").replace(b".0\n", b"\n"), columns)
    return rows if rows is not None else _one_by_one(block, stored, columns, name, first_line)


def plain_row(block: bytes, decimal_comma: bool = False) -> bytes:
    """Lines with blanks between plain numbers: no quotes, no carriage returns, 1 and 0 for True, ON and False, OFF."""
    return _without_words(_divided_by_blanks(block, decimal_comma))


def _divided_by_blanks(block: bytes, decimal_comma: bool) -> bytes:
    if decimal_comma:
        block = block.translate(_COMMAS_TO_POINTS)
    elif any(mark in block for mark in (b",", b";", b"\t")):
        block = block.translate(_TO_SPACES)
    return block.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in block else block


def _without_words(block: bytes) -> bytes:
    """Quotes and words cost as much as all the rest, so they are looked for only where rows are not regular."""
    block = block.replace(b'"', b"").replace(b"'", b"").replace(b"  ", b" ")
    if _WORDS.search(block) is not None:
        block = _WORDS.sub(lambda found: b"1" if found[0].lower() in (b"true", b"on") else b"0", block)
    return block


def _fast(block: bytes, columns: Columns) -> Rows | None:
    if b"-" not in block or columns.p != columns.count - 1 or b" 2\n" in block:
        return _regular(block, columns)
    rows = _regular(block.replace(b" -1\n", b" 2\n"), columns)
    if rows is None:
        return None
    p = rows.p.astype(np.int64)
    return replace(rows, p=np.where(p == 2, -1, p))


def _regular(block: bytes, columns: Columns) -> Rows | None:
    """The fast way; None when the block is not regular enough for it."""
    text = Padded.of(block)
    if int(text.octets.max()) > ord("9"):
        return None
    has_point = b"." in block[: block.index(b"\n")]
    marks = np.flatnonzero(text.octets < ord("0"))
    num_rows, left_over = divmod(len(marks), columns.count + has_point)
    if left_over or num_rows == 0:
        return None
    ends = np.ascontiguousarray(marks.reshape(num_rows, -1).T)
    lengths = np.empty_like(ends)
    lengths[0, 0] = ends[0, 0] - MARGIN
    lengths[0, 1:] = ends[0, 1:] - ends[-1, :-1] - 1
    np.subtract(ends[1:], ends[:-1], out=lengths[1:])
    lengths[1:] -= 1
    places = [i + (has_point and i >= columns.t) for i in range(columns.count)]
    pixels_and_sign = [places[i] for i in (columns.x, columns.y, columns.p)]
    if not _is_regular(text, ends, columns.t if has_point else None) or int(lengths.min()) < 1:
        return None
    if max(int(lengths[i].max()) for i in pixels_and_sign) > LONGEST_WHOLE:
        return None
    t = _stamps(text, ends, lengths, columns, has_point)
    if t is None:
        return None
    x, y, p = (whole_numbers(text, ends[i], lengths[i]) for i in pixels_and_sign)
    return Rows(x, y, t, p, num_rows)


def _is_regular(text: Padded, ends: Int64[np.ndarray, "k n"], point: int | None) -> bool:
    """Whether each token ends in a blank, each row in a line feed, and the mark numbered `point` is a point."""
    marks = bytearray(b" " * (len(ends) - 1) + b"\n")
    if point is not None:
        marks[point] = ord(".")
    return all(bool((text.octets.take(places) == mark).all()) for places, mark in zip(ends, marks, strict=True))


def _stamps(
    text: Padded, ends: Int64[np.ndarray, "k n"], lengths: Int64[np.ndarray, "k n"], columns: Columns, has_point: bool
) -> Int64[np.ndarray, " n"] | None:
    place = columns.t
    if not has_point:
        if columns.unit not in ("us", "ns") or int(lengths[place].max()) > LONGEST_WHOLE:
            return None
        whole = whole_numbers(text, ends[place], lengths[place]).astype(np.int64)
        return whole if columns.unit == "us" else from_nanoseconds(whole)
    if columns.unit != "s" or int(lengths[place + 1].max()) > LONGEST_FRACTION or int(lengths[place].max()) > 12:
        return None
    return microseconds(text, ends[place], lengths[place], lengths[place + 1])


def _one_by_one(block: bytes, stored: bytes, columns: Columns, name: str, first_line: int) -> Rows:
    """The patient way: any number that `decimal` reads, any run of blanks, empty lines and comments skipped.

    `stored` is the block as it stands in the file.
    """
    kept: list[tuple[int, int, int, int]] = []
    scale = _SCALES[columns.unit]
    for number, line in enumerate(block.split(b"\n"), first_line):
        tokens = line.split()
        if not tokens or tokens[0].startswith((b"#", b"%", b"//")):
            continue
        try:
            if len(tokens) != columns.count:
                raise ValueError(f"{len(tokens)} columns")
            values = [Decimal(tokens[i].decode("ascii")) for i in (columns.x, columns.y, columns.t, columns.p)]
            if not all(value.is_finite() and value.adjusted() <= _MOST_DIGITS for value in values):
                raise ValueError("a number beyond 64 bits")
            stamp = int((values[2] * scale).to_integral_value(ROUND_HALF_EVEN))
            x, y = (_pixel(value, columns.rounds) for value in values[:2])
            p = _whole(values[3])
            if max(abs(x), abs(y)) >= 2**31 or abs(p) >= 2**63 or abs(stamp) >= 2**62:
                raise ValueError("a number beyond 64 bits")
            kept.append((x, y, stamp, p))
        except _Fraction as slip:
            raise RecordingError(
                f"{name}: line {number} has a pixel at {slip}, a fraction (rectified?); open it with --pixels rounded"
            ) from None
        except (ValueError, InvalidOperation, OverflowError) as slip:
            shown = stored.splitlines()[number - first_line][:60].decode("utf-8", "replace").rstrip()
            raise RecordingError(
                f'{name}: line {number} reads "{shown}"; wanted {columns.count} numbers '
                f"(time, x, y and polarity among them); correct or remove the line"
            ) from slip
    table = np.array(kept, np.int64).reshape(-1, 4)
    x, y, t, p = (table[:, i].copy() for i in range(4))
    return Rows(x, y, t, p, block.count(b"\n"))


class _Fraction(Exception):
    """A pixel with a fraction."""


def _pixel(value: Decimal, rounds: bool) -> int:
    if rounds:
        return int(value.to_integral_value(ROUND_HALF_EVEN))
    if value != value.to_integral_value():
        raise _Fraction(str(value))
    return int(value)


def _whole(value: Decimal) -> int:
    if value != value.to_integral_value():
        raise ValueError("a fraction where a whole number is due")
    return int(value)
