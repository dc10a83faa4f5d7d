"""Streams of words with a memory: each word's meaning depends on the last one of some kind before it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int64, Shaped, UInt32


def last_before(is_mark: Bool[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """For each word the place of the last marked one up to it; −1 before the first."""
    places = np.where(is_mark, np.arange(len(is_mark)), -1)
    return np.maximum.accumulate(places) if len(places) else places


def held(values: Shaped[np.ndarray, " n"], is_mark: Bool[np.ndarray, " n"], start: int) -> Shaped[np.ndarray, " n"]:
    """Each word's last marked value up to it; `start` before the first."""
    places = last_before(is_mark)
    kept = values[np.maximum(places, 0)]
    return np.where(places >= 0, kept, np.asarray(start, values.dtype))


def set_bits(masks: UInt32[np.ndarray, " n"]) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " m"]]:
    """Row and bit of every set bit of 32-bit masks, lowest bit first within a row."""
    octets = masks.astype("<u4").view(np.uint8)
    places = np.flatnonzero(np.unpackbits(octets, bitorder="little"))
    return places >> 5, places & 31


def unrolled(stamps: Int64[np.ndarray, " n"], period: int, last: int | None, turns: int) -> tuple[np.ndarray, int]:
    """Counters that wrap after `period` as ever growing ones, and the number of turns after the last.

    `last` is the counter before the first. Steps back by less than half a period are left for others to judge.
    """
    if len(stamps) == 0:
        return stamps, turns
    steps = np.diff(stamps, prepend=stamps[0] if last is None else last)
    turned = turns + np.cumsum((steps < -(period // 2)).astype(np.int64) - (steps > period // 2))
    return stamps + turned * period, int(turned[-1])
