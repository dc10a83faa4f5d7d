"""Decimal numbers out of bytes, a whole column at a time and without rounding errors.

Eight digits are one 64-bit word: a column of numbers is gathered as words that end (or begin) where its tokens do,
and three multiplications turn the digits into a value (Lemire 2021, "Number parsing at a gigabyte per second").
numpy's own text parsers read one million events a second; this reads more than ten.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64, Integer, UInt8, UInt16, UInt64

MARGIN = 32
"""Bytes of padding that a buffer carries on both sides, so that words may reach over its ends."""

LONGEST_WHOLE = 18
"""Digits of a whole number that surely fit 64 bits with a sign."""

LONGEST_FRACTION = 16
"""Digits after the point that two words hold."""

_FEW_DIGITS = 4
"""Up to so many digits a number is put together digit by digit: a word costs as much as five of them."""

_ZERO = ord("0")
_ZEROS = np.uint64(0x3030303030303030)


@dataclass(frozen=True, slots=True)
class Padded:
    """Bytes with `MARGIN` digits "0" on both sides, readable as 64-bit words at any offset."""

    octets: UInt8[np.ndarray, " n"]
    words: UInt64[np.ndarray, " m"]

    @staticmethod
    def of(content: bytes) -> Padded:
        """Positions in `content` are positions in `octets` less `MARGIN`."""
        octets = np.empty(len(content) + 2 * MARGIN, np.uint8)
        octets[:MARGIN] = octets[-MARGIN:] = _ZERO
        octets[MARGIN:-MARGIN] = np.frombuffer(content, np.uint8)
        words = np.ndarray((len(octets) - 7,), "<u8", octets, strides=(1,))
        return Padded(octets, words)


def whole_numbers(
    text: Padded, stops: Int64[np.ndarray, " n"], lengths: Int64[np.ndarray, " n"]
) -> Integer[np.ndarray, " n"]:
    """The unsigned integers whose last digit lies just before `stops`: 1 … LONGEST_WHOLE digits, nothing else.

    As uint16 where none has more than four digits, else as int64.
    """
    longest = int(lengths.max(initial=0))
    if longest <= _FEW_DIGITS:
        return _short_numbers(text, stops, lengths, longest)
    value = _last_digits(text, stops, np.minimum(lengths, 8) if longest > 8 else lengths)
    for taken, weight in ((8, 10**8), (16, 10**16)):
        if longest > taken:
            value += weight * _last_digits(text, stops - taken, np.clip(lengths - taken, 0, 8))
    return value


def microseconds(
    text: Padded,
    points: Int64[np.ndarray, " n"],
    num_whole: Int64[np.ndarray, " n"],
    num_decimals: Int64[np.ndarray, " n"],
) -> Int64[np.ndarray, " n"]:
    """Decimal seconds "12.345678901" as µs, exact, rounded half to even, from where their points are.

    `num_whole` digits before the point, 1 … LONGEST_WHOLE, and `num_decimals` after it, at most LONGEST_FRACTION.
    """
    stamps = np.multiply(whole_numbers(text, points, num_whole), 1_000_000, dtype=np.int64)
    eight = _first_digits(text, points + 1, num_decimals)
    whole = eight // 100
    rest = eight - whole * 100
    whole += rest > 50
    ties = np.flatnonzero(rest == 50)
    if len(ties):
        beyond = _first_digits(text, points[ties] + 9, np.maximum(num_decimals[ties] - 8, 0))
        whole[ties] += (beyond > 0) | ((whole[ties] & 1) == 1)
    stamps += whole
    return stamps


def _short_numbers(
    text: Padded, stops: Int64[np.ndarray, " n"], lengths: Int64[np.ndarray, " n"], longest: int
) -> UInt16[np.ndarray, " n"]:
    places = stops - 1
    values = text.octets.take(places).astype(np.uint16)
    values -= _ZERO
    for power in range(1, longest):
        places -= 1
        digits = text.octets.take(places)
        digits -= _ZERO  # of a byte that is no digit of this number it is nonsense, which the next line makes 0
        digits *= lengths > power
        values += np.multiply(digits, 10**power, dtype=np.uint16)
    return values


def _last_digits(
    text: Padded, stops: Int64[np.ndarray, " n"], lengths: Int64[np.ndarray, " n"]
) -> Int64[np.ndarray, " n"]:
    # A shift by all 64 bits is undefined, so it is made of two halves.
    half = (32 - 4 * lengths).astype(np.uint64)
    words = text.words[stops - 8] ^ _ZEROS
    return _combine(words >> half >> half << half << half)


def _first_digits(
    text: Padded, starts: Int64[np.ndarray, " n"], lengths: Int64[np.ndarray, " n"]
) -> Int64[np.ndarray, " n"]:
    """The first eight digits, or as many as there are, as if noughts followed."""
    words = text.words[starts]
    words ^= _ZEROS
    if len(lengths) and int(lengths.min()) >= 8:
        return _combine(words)
    half = (32 - 4 * np.minimum(lengths, 8)).astype(np.uint64)
    return _combine(words << half << half >> half >> half)


def _combine(digits: UInt64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """Eight bytes 0 … 9, the first one the highest, as one number. Works in place: `digits` is the caller's scratch."""
    digits *= np.uint64(2561)
    digits >>= np.uint64(8)
    digits &= np.uint64(0x00FF00FF00FF00FF)
    digits *= np.uint64(6553601)
    digits >>= np.uint64(16)
    digits &= np.uint64(0x0000FFFF0000FFFF)
    digits *= np.uint64(42949672960001)
    digits >>= np.uint64(32)
    return digits.view(np.int64)
