"""Prophesee EVT 2.0 and 3.0 words to events, a block of the file at a time, with what the words before it said.

Layouts: docs.prophesee.ai, "EVT 2.0 format" (32-bit words: type 4 bits, low time 6, x 11, y 11; type 8 carries the high
28 bits of the time) and "EVT 3.0 format" (16-bit words: type 4 bits, then 12 bits of y, x, masks
of 12 or 8 pixels, or time).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, Shaped, UInt8, UInt16, UInt32

from etnet.events.formats.collect import Decoded
from etnet.events.formats.words import set_bits

_EVT2_HIGH = 8
_Y, _X, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH = 0, 2, 3, 4, 5, 6, 8


class State(NamedTuple):
    """What a block's first words depend on. Whole numbers all, so that an index can hold it as a row."""

    turns: int = 0
    """How often the high time began anew."""
    high: int = -1
    """The last high time; −1 before the first, and events before it have no time."""
    low: int = 0
    y: int = 0
    base_x: int = 0
    base_on: int = 0
    last: int = 0
    """The largest stamp so far, µs: an earlier one is held at it."""


@dataclass
class Notes:
    """What was odd, over all blocks."""

    num_untimed: int = 0
    num_held: int = 0
    farthest_back: int = 0


Decode = Callable[[np.ndarray, State, Notes], tuple[Decoded, State]]
Skim = Callable[[np.ndarray, State, Notes], tuple[int, State]]
"""As `Decode`, but only how many events there are."""


@dataclass(frozen=True)
class Version:
    """How one EVT version's words are read."""

    word: np.dtype
    decode: Decode
    skim: Skim


def decode_evt2(words: UInt32[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    """One word an event."""
    kind = words >> np.uint32(28)
    highs, places = np.flatnonzero(kind == _EVT2_HIGH), np.flatnonzero(kind < 2)
    places = _timed(places, highs, state, notes)
    events = words[places]
    times, after = _high_times(words[highs] & 0xFFFFFFF, 28, state)
    t = _filled(times, np.searchsorted(places, highs), len(events), max(state.high, 0) + (state.turns << 28))
    t <<= 6
    t |= (events >> np.uint32(22)) & 0x3F
    t = _held(t, state.last, notes)
    x, y = ((events >> np.uint32(11)) & 0x7FF).astype(np.uint16), (events & 0x7FF).astype(np.uint16)
    last = int(t[-1]) if len(t) else state.last
    return Decoded(x, y, t, (events >> np.uint32(28)).astype(bool)), after._replace(last=last)


def _skim_evt2(words: UInt32[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    decoded, after = decode_evt2(words, state, notes)
    return len(decoded.t), after


def decode_evt3(words: UInt16[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    """Words with memory: y, time and the base of masks hold for the words after them."""
    kind = (words >> np.uint16(12)).astype(np.uint8)
    clock, times, after = _clock(words, kind, state, notes)
    is_vector = (kind == _VECTOR_12) | (kind == _VECTOR_8)
    is_event = (kind == _X) | is_vector
    places = _timed(np.flatnonzero(is_event), np.flatnonzero(kind == _HIGH), state, notes)
    is_event[: places[0] if len(places) else len(words)] = False
    before = np.cumsum(is_event, dtype=np.int64)
    num, events, sort = len(places), words[places], kind[places]
    lines, bases = np.flatnonzero(kind == _Y), np.flatnonzero(kind == _BASE)
    y = _filled(words[lines] & 0x7FF, before[lines], num, state.y)
    t = _filled(times, before[clock], num, state.last)
    x, on = events & 0x7FF, (events & 0x800) != 0
    if len(lines):
        after = after._replace(y=int(words[lines[-1]] & 0x7FF))
    start, base_on, after = _vector_starts(words[bases], before[bases], sort, after)
    if not is_vector.any():
        return Decoded(x, y, t, on), after
    rows, bits = _unmasked(events, sort)
    is_single = (sort == _X)[rows]
    x = np.where(is_single, x[rows], start[rows] + bits)
    return Decoded(x, y[rows], t[rows], np.where(is_single, on[rows], base_on[rows])), after


def _skim_evt3(words: UInt16[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    """Without the events' pixels: a third of the work."""
    kind = (words >> np.uint16(12)).astype(np.uint8)
    if state.high < 0:
        decoded, after = decode_evt3(words, state, notes)
        return len(decoded.t), after
    _, _, after = _clock(words, kind, state, notes)
    lines, bases = np.flatnonzero(kind == _Y), np.flatnonzero(kind == _BASE)
    if len(lines):
        after = after._replace(y=int(words[lines[-1]] & 0x7FF))
    vectors = np.flatnonzero((kind == _VECTOR_12) | (kind == _VECTOR_8))
    sort = kind[vectors]
    _, _, after = _vector_starts(words[bases], np.searchsorted(vectors, bases), sort, after)
    num_single = int(np.count_nonzero(kind == _X))
    return num_single + int(np.bitwise_count(_masks(words[vectors], sort)).sum(dtype=np.int64)), after


EVT = {
    "2.0": Version(np.dtype("<u4"), decode_evt2, _skim_evt2),
    "3.0": Version(np.dtype("<u2"), decode_evt3, _skim_evt3),
}


def _clock(
    words: UInt16[np.ndarray, " n"], kind: UInt8[np.ndarray, " n"], state: State, notes: Notes
) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " m"], State]:
    """Where EVT 3.0's time words are, the stamp from each on, and the state with the time after them."""
    clock = np.flatnonzero((kind == _LOW) | (kind == _HIGH))
    is_high = kind[clock] == _HIGH
    highs = np.flatnonzero(is_high)
    value = words[clock] & np.uint16(0xFFF)
    high_times, after = _high_times(value[highs], 12, state)
    # A high time begins with the low time 0.
    times = np.where(is_high, 0, value).astype(np.int64)
    start = max(state.high, 0) + (state.turns << 12)
    times |= np.repeat(np.append(np.int64(start), high_times), np.diff(highs, prepend=0, append=len(clock))) << 12
    # Cameras repeat the high time as they go, with no step back: only low times tell of one.
    times = _held(times, state.last, notes, ~is_high)
    return clock, times, after._replace(last=int(times[-1]) if len(times) else state.last)


def _vector_starts(
    bases: UInt16[np.ndarray, " b"], before: Int64[np.ndarray, " b"], kind: UInt8[np.ndarray, " n"], state: State
) -> tuple[Int64[np.ndarray, " n"], Bool[np.ndarray, " n"], State]:
    """The leftmost pixel and the polarity of each event word taken as a mask; each mask moves the base to its right."""
    width = np.where(kind == _VECTOR_12, 12, np.where(kind == _VECTOR_8, 8, 0))
    ends = np.concatenate([[0], np.cumsum(width)])
    origin = _filled((bases & 0x7FF).astype(np.int64) - ends[before], before, len(kind), state.base_x)
    on = _filled((bases & 0x800) != 0, before, len(kind), bool(state.base_on))
    last = int(bases[-1] & 0x7FF) - int(ends[before[-1]]) if len(bases) else state.base_x
    last_on = int(bases[-1]) >> 11 & 1 if len(bases) else state.base_on
    # A base that only masks without end would move is no pixel any more; the state stays a small number.
    return origin + ends[:-1], on, state._replace(base_x=min(last + int(ends[-1]), 1 << 20), base_on=last_on)


def _unmasked(
    events: UInt16[np.ndarray, " n"], kind: UInt8[np.ndarray, " n"]
) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " m"]]:
    """Each event's word and its bit in the word's mask, lowest first; a word without a mask has one event, bit 0."""
    places = np.flatnonzero(kind != _X)
    masks = _masks(events[places], kind[places])
    counts = np.ones(len(events), np.int64)
    counts[places] = np.bitwise_count(masks)
    rows = np.repeat(np.arange(len(events)), counts)
    bits = np.zeros(len(rows), np.int64)
    _, set_ones = set_bits(masks)
    first = np.cumsum(counts)[places] - counts[places]
    within = np.arange(len(set_ones)) - np.repeat(np.cumsum(counts[places]) - counts[places], counts[places])
    bits[np.repeat(first, counts[places]) + within] = set_ones
    return rows, bits


def _masks(words: UInt16[np.ndarray, " n"], kind: UInt8[np.ndarray, " n"]) -> UInt32[np.ndarray, " n"]:
    return (words & np.where(kind == _VECTOR_12, 0xFFF, 0xFF)).astype(np.uint32)


def _filled(
    values: Shaped[np.ndarray, " m"], before: Int64[np.ndarray, " m"], num_events: int, start: int | bool
) -> Shaped[np.ndarray, " n"]:
    """Each event's last value, `start` before the first. `before` counts the events before each value."""
    counts = np.diff(before, prepend=0, append=num_events)
    return np.repeat(np.concatenate([np.array([start], values.dtype), values]), counts)


def _high_times(values: Shaped[np.ndarray, " m"], bits: int, state: State) -> tuple[Int64[np.ndarray, " m"], State]:
    """High times as ever growing ones, and the state after them."""
    counters = values.astype(np.int64)
    if len(counters) == 0:
        return counters, state
    steps = np.diff(counters, prepend=max(state.high, 0))
    turns = state.turns + np.cumsum(steps < -(1 << bits - 1))
    return counters + (turns << bits), state._replace(turns=int(turns[-1]), high=int(counters[-1]))


def _timed(
    places: Int64[np.ndarray, " n"], highs: Int64[np.ndarray, " m"], state: State, notes: Notes
) -> Int64[np.ndarray, " k"]:
    """Without the event words before the stream's first high time."""
    if state.high >= 0:
        return places
    first = int(np.searchsorted(places, highs[0])) if len(highs) else len(places)
    notes.num_untimed += first
    return places[first:]


def _held(
    t: Int64[np.ndarray, " n"], last: int, notes: Notes, is_told: Bool[np.ndarray, " n"] | bool = True
) -> Int64[np.ndarray, " n"]:
    """Stamps that step back are held at the largest one before them; noted where `is_told`."""
    if len(t) == 0 or (t[0] >= last and not bool((t[1:] < t[:-1]).any())):
        return t
    highest = np.maximum(np.maximum.accumulate(t), last)
    back = np.where(is_told, highest - t, 0)
    notes.num_held += int(np.count_nonzero(back))
    notes.farthest_back = max(notes.farthest_back, int(back.max()))
    return highest
