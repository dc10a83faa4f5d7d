"""Prophesee's ECF compression of HDF5 chunks (filter 36559), decoded with numpy.

A chunk is: u32 header (events · 4 + mode) · u64 first time · times as (step, count) nibbles; then, by mode:
2: y, x and p packed in 24 bits · 1: y run-lengths, then x and p packed in 12 bits · 0: y run-lengths, x with a mask of
the five pixels to its right, p run-lengths. A count at its maximum is followed by the true one in 16 bits.
Layout: prophesee-ai/hdf5_ecf, the codec's documentation and the files it writes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, Shaped

LARGEST_CHUNK = 65_535
"""Events in a chunk: what the codec allows."""

_FIRST_LOOK = 4096


class Chunk(NamedTuple):
    """Decoded columns of one chunk."""

    x: Int64[np.ndarray, " n"]
    y: Int64[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Int64[np.ndarray, " n"]


class DamagedChunk(ValueError):
    """The bytes are no ECF chunk."""


def decode_chunk(content: bytes) -> Chunk:
    """Decode the raw bytes of one chunk."""
    if len(content) < 12:
        raise DamagedChunk(f"a chunk of {len(content)} bytes is too short")
    header = int.from_bytes(content[:4], "little")
    num_events, mode = header >> 2, header & 3
    if not 0 < num_events <= LARGEST_CHUNK:
        raise DamagedChunk(f"a chunk that claims {num_events} events")
    t, place = _times(content, num_events)
    if mode & 2:
        packed = _packed(content, place, num_events, "<u4", 24)
        return Chunk((packed >> 1) & 0x7FF, (packed >> 12) & 0x7FF, t, packed & 1)
    y, place = _runs(content, place, num_events, "<u2", 5)
    if mode & 1:
        packed = _packed(content, place, num_events, "<u2", 12)
        return Chunk(packed >> 1, y, t, packed & 1)
    x, place = _neighbours(content, place, num_events)
    p, _ = _runs(content, place, num_events, "u1", 7)
    return Chunk(x, y, t, p)


def _times(content: bytes, num_events: int) -> tuple[Int64[np.ndarray, " n"], int]:
    """High nibble: a step in µs; low nibble: how many events. A step of 15 adds the low nibble to a long step."""
    start, look = 12, _FIRST_LOOK
    while True:
        octets = np.frombuffer(content, np.uint8, min(look, len(content) - start), start).astype(np.int64)
        steps, counts = octets >> 4, octets & 15
        begins = _begins((counts == 15) & (steps != 15), 2)
        places = np.flatnonzero(begins)
        step, count = steps[places], counts[places]
        is_long = step == 15
        count = _true_counts(octets, places, np.where(is_long, 0, count), 15)
        total = np.cumsum(count)
        if len(total) and total[-1] >= num_events:
            break
        if look >= len(content) - start:
            raise DamagedChunk("its times end early")
        look *= 8
    runs = np.arange(len(step)) - np.maximum.accumulate(np.where(~is_long, np.arange(len(step)), -1)) - 1
    if bool((runs[is_long] > 14).any()):
        raise DamagedChunk("a step of time beyond 60 bits")
    moves = np.where(is_long, octets[places] & 15, step) << np.where(is_long, 4 * runs, 0)
    first = int.from_bytes(content[4:12], "little")
    if first >= 2**62:
        raise DamagedChunk("a first time beyond 62 bits")
    times = first + np.cumsum(moves)
    last = int(np.searchsorted(total, num_events))
    used = int(places[last]) + (3 if counts[places[last]] == 15 and not is_long[last] else 1)
    if start + used > len(content):
        raise DamagedChunk("its times end early")
    return np.repeat(times[: last + 1], count[: last + 1])[:num_events], start + used


def _runs(content: bytes, start: int, num_events: int, word: str, num_bits: int) -> tuple[Int64[np.ndarray, " n"], int]:
    """(value, count) words; the count has `num_bits`, and its maximum means that 16 bits follow with the true one."""
    size, maximum = np.dtype(word).itemsize, (1 << num_bits) - 1
    available, look = (len(content) - start) // size, _FIRST_LOOK
    while True:
        words = np.frombuffer(content, word, max(0, min(look, available)), start).astype(np.int64)
        places = np.flatnonzero(_begins((words & maximum) == maximum, 2 // size))
        count = _true_counts(words, places, words[places] & maximum, maximum, size)
        total = np.cumsum(count)
        if len(total) and total[-1] >= num_events:
            break
        if look >= available:
            raise DamagedChunk("its run-lengths end early")
        look *= 8
    last = int(np.searchsorted(total, num_events))
    used = int(places[last]) + (1 + 2 // size if (words[places[last]] & maximum) == maximum else 1)
    if used > available:
        raise DamagedChunk("its run-lengths end early")
    values = words[places[: last + 1]] >> num_bits
    return np.repeat(values, count[: last + 1])[:num_events], start + used * size


def _true_counts(
    words: Int64[np.ndarray, " n"],
    places: Int64[np.ndarray, " m"],
    count: Int64[np.ndarray, " m"],
    maximum: int,
    size: int = 1,
) -> Int64[np.ndarray, " m"]:
    """Counts, with those at the maximum replaced by the 16 bits behind them (0 where these are cut off)."""
    long = np.flatnonzero(count == maximum)
    behind = places[long]
    padded = np.concatenate([words, np.zeros(2, np.int64)])
    exact = padded[behind + 1] | (padded[behind + 2] << 8) if size == 1 else padded[behind + 1]
    count = count.copy()
    count[long] = exact
    return count


def _begins(is_long: Bool[np.ndarray, " n"], extra: int) -> Bool[np.ndarray, " n"]:
    """Which words begin a token, if each long token is followed by `extra` words of its own."""
    begins = np.ones(len(is_long), bool)
    free = 0
    for place in np.flatnonzero(is_long).tolist():
        if place >= free:
            begins[place + 1 : place + 1 + extra] = False
            free = place + 1 + extra
    return begins


def _neighbours(content: bytes, start: int, num_events: int) -> tuple[Int64[np.ndarray, " n"], int]:
    """Words of x (11 bits) and a mask of which of the five pixels to its right follow."""
    words = np.frombuffer(content, "<u2", min(num_events, (len(content) - start) // 2), start).astype(np.int64)
    present = np.ones((len(words), 6), bool)
    for i in range(5):
        present[:, i + 1] = (words >> (4 - i)) & 1
    total = np.cumsum(present.sum(1))
    if not len(total) or total[-1] < num_events:
        raise DamagedChunk("its x column ends early")
    last = int(np.searchsorted(total, num_events))
    x = (words[:, None] >> 5) + np.arange(6)
    return x[: last + 1][present[: last + 1]][:num_events], start + 2 * (last + 1)


def _packed(content: bytes, start: int, num_events: int, word: str, num_bits: int) -> Shaped[np.ndarray, " n"]:
    """Four values of `num_bits` in three words each."""
    num_groups = -(-num_events // 4)
    size = np.dtype(word).itemsize
    if len(content) - start < num_groups * 3 * size:
        raise DamagedChunk("its packed pixels end early")
    a, b, c = np.frombuffer(content, word, num_groups * 3, start).reshape(-1, 3).T.astype(np.int64)
    part, width = num_bits // 3, size * 8
    low, middle, high = (1 << part) - 1, (1 << 2 * part) - 1, (1 << num_bits) - 1
    values = (
        a >> part,
        (a & low) | ((b >> (width - 2 * part)) << part),
        (b & middle) | ((c >> (width - part)) << 2 * part),
        c & high,
    )
    return np.stack(values, 1).reshape(-1)[:num_events]
