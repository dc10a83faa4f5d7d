"""Prophesee EVT 2.0 and 3.0 words to events, a block of the file at a time, with what the words before it said.

Layouts: docs.prophesee.ai, "EVT 2.0 format" (32-bit words: type 4 bits, low time 6, x 11, y 11; type 8 carries the high
28 bits of the time) and "EVT 3.0 format" (16-bit words: type 4 bits, then 12 bits of y, x, masks
of 12 or 8 pixels, or time). In both, type 10 is an edge on a trigger input: its lowest bit tells a rising one, and 4 or
5 bits from the 8th on the input's number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int64, Integer, Shaped, UInt8, UInt16, UInt32

from etnet.events.formats.decode import Decoded
from etnet.events.formats.trigger_table import TriggerTable

TRIGGER = 10
_EVT2_HIGH = 8
_Y, _X, _BASE, _VECTOR_12, _VECTOR_8, _LOW, _HIGH, _OTHER = 0, 2, 3, 4, 5, 6, 8, 15


class State(NamedTuple):
    """What a block's first words depend on. Whole numbers all, so that an index can hold it as a row."""

    turns: int = 0
    """How often the high time wrapped."""
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
    """What was odd, and what lay between the events, over all blocks."""

    num_untimed: int = 0
    num_held: int = 0
    farthest_back: int = 0
    triggers: TriggerTable = field(default_factory=TriggerTable, compare=False)


Decode = Callable[[np.ndarray, State, Notes], tuple[Decoded, State]]
Skim = Callable[[np.ndarray, State, Notes], tuple[int, State]]
"""As `Decode`, but only how many events there are."""


@dataclass(frozen=True)
class Version:
    """How one EVT version's words are read. Indices are kept under its name."""

    name: str
    word: np.dtype
    decode: Decode
    skim: Skim


def decode_evt2(words: UInt32[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    """One word an event."""
    kind = words >> np.uint32(28)
    highs, places = np.flatnonzero(kind == _EVT2_HIGH), np.flatnonzero(kind < 2)
    triggers = np.flatnonzero(kind == TRIGGER)
    places = timed_places(places, highs, state, notes)
    events = words[places]
    times, after = high_times(words[highs] & 0xFFFFFFF, 28, state)
    _note_evt2_triggers(words[triggers], np.searchsorted(highs, triggers), times, state, notes)
    t = _filled(times, np.searchsorted(places, highs), len(events), max(state.high, 0) + (state.turns << 28))
    t <<= 6
    t |= (events >> np.uint32(22)) & 0x3F
    t = held_stamps(t, state.last, notes)
    x, y = ((events >> np.uint32(11)) & 0x7FF).astype(np.uint16), (events & 0x7FF).astype(np.uint16)
    last = int(t[-1]) if len(t) else state.last
    return Decoded(x, y, t, (events >> np.uint32(28)).astype(bool)), after._replace(last=last)


def _note_evt2_triggers(
    words: UInt32[np.ndarray, " n"],
    before: Int64[np.ndarray, " n"],
    times: Int64[np.ndarray, " m"],
    state: State,
    notes: Notes,
) -> None:
    """`before` counts the high times before each; what comes before the stream's first one has no time."""
    start = max(state.high, 0) + (state.turns << 28)
    high = np.append(np.int64(start), times)[before]
    stamps = high << 6 | ((words >> np.uint32(22)) & np.uint32(0x3F)).astype(np.int64)
    timed = (before > 0) | (state.high >= 0)
    channels, edges = (words >> np.uint32(8)) & np.uint32(0x1F), (words & np.uint32(1)).astype(np.int8) * 2 - 1
    notes.triggers.add(stamps[timed], channels[timed], edges[timed])


def _skim_evt2(words: UInt32[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    decoded, after = decode_evt2(words, state, notes)
    return len(decoded.t), after


def decode_evt3(words: UInt16[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    """Words with memory: y, time and the base of masks hold for the words after them."""
    kind = _kinds(words, state, notes)
    clock, times, after = _clock(words, kind, state, notes)
    _note_evt3_triggers(words, kind, clock, times, state, notes)
    is_single = kind == _X
    singles = np.flatnonzero(is_single)
    vectors = np.flatnonzero((kind == _VECTOR_12) | (kind == _VECTOR_8))
    sort = kind[vectors]
    masks = _masks(words[vectors], sort)
    counts = is_single.view(np.uint8)
    counts[vectors] = np.bitwise_count(masks)
    # A block has far fewer events than 32 bits count, and they are counted four times faster than in 64.
    before = np.cumsum(counts, dtype=np.int32)
    num = int(before[-1]) if len(before) else 0
    lines, bases = np.flatnonzero(kind == _Y), np.flatnonzero(kind == _BASE)
    y = _filled(words[lines] & np.uint16(0x7FF), before[lines], num, state.y)
    t = _filled(times, before[clock], num, state.last)
    if len(lines):
        after = after._replace(y=int(words[lines[-1]] & 0x7FF))
    start, base_on, after = _vector_starts(words[bases], np.searchsorted(vectors, bases), sort, after)
    if not len(vectors):
        pixels = words[singles]
        return Decoded(pixels & np.uint16(0x7FF), y, t, pixels & np.uint16(0x800) != 0), after
    masked = Masks(masks, counts[vectors], start, base_on)
    if not len(singles):
        x, on = _columns_of(masked)
        return Decoded(x, y, t, on), after
    x, on = _with_masks(words[singles], before[singles], before[vectors], masked)
    return Decoded(x, y, t, on), after


def _skim_evt3(words: UInt16[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    """Without the events' pixels: a third of the work."""
    kind = _kinds(words, state, notes)
    clock, times, after = _clock(words, kind, state, notes)
    _note_evt3_triggers(words, kind, clock, times, state, notes)
    lines, bases = np.flatnonzero(kind == _Y), np.flatnonzero(kind == _BASE)
    if len(lines):
        after = after._replace(y=int(words[lines[-1]] & 0x7FF))
    vectors = np.flatnonzero((kind == _VECTOR_12) | (kind == _VECTOR_8))
    sort = kind[vectors]
    _, _, after = _vector_starts(words[bases], np.searchsorted(vectors, bases), sort, after)
    num_single = int(np.count_nonzero(kind == _X))
    return num_single + int(np.bitwise_count(_masks(words[vectors], sort)).sum(dtype=np.int64)), after


EVT = {
    "2.0": Version("2.0", np.dtype("<u4"), decode_evt2, _skim_evt2),
    "3.0": Version("3.0", np.dtype("<u2"), decode_evt3, _skim_evt3),
}


def _kinds(words: UInt16[np.ndarray, " n"], state: State, notes: Notes) -> UInt8[np.ndarray, " n"]:
    """Each word's type; event words before the stream's first high time count as words without a meaning."""
    kind = (words >> np.uint16(12)).astype(np.uint8)
    if state.high < 0:
        early = kind[: int(np.argmax(kind == _HIGH)) if (kind == _HIGH).any() else len(kind)]
        is_event = (early == _X) | (early == _VECTOR_12) | (early == _VECTOR_8)
        notes.num_untimed += int(np.count_nonzero(is_event))
        early[is_event | (early == TRIGGER)] = _OTHER
    return kind


def _note_evt3_triggers(
    words: UInt16[np.ndarray, " n"],
    kind: UInt8[np.ndarray, " n"],
    clock: Int64[np.ndarray, " m"],
    times: Int64[np.ndarray, " m"],
    state: State,
    notes: Notes,
) -> None:
    """Triggers have the time of the last time word before them."""
    places = np.flatnonzero(kind == TRIGGER)
    if len(places):
        stamps = np.append(np.int64(state.last), times)[np.searchsorted(clock, places)]
        found = words[places]
        edges = (found & np.uint16(1)).astype(np.int8) * 2 - 1
        notes.triggers.add(stamps, (found >> np.uint16(8)) & np.uint16(0xF), edges)


def clock_words(
    words: UInt16[np.ndarray, " n"], state: State, notes: Notes
) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " m"], State]:
    """Where EVT 3.0's time words are among `words`, the stamp from each on, and the state with the time after them."""
    return _clock(words, _kinds(words, state, notes), state, notes)


def _clock(
    words: UInt16[np.ndarray, " n"], kind: UInt8[np.ndarray, " n"], state: State, notes: Notes
) -> tuple[Int64[np.ndarray, " m"], Int64[np.ndarray, " m"], State]:
    """Where EVT 3.0's time words are, the stamp from each on, and the state with the time after them."""
    clock = np.flatnonzero((kind == _LOW) | (kind == _HIGH))
    is_high = kind[clock] == _HIGH
    highs = np.flatnonzero(is_high)
    value = words[clock] & np.uint16(0xFFF)
    after_high, after = high_times(value[highs], 12, state)
    # A high time begins with the low time 0.
    times = value.astype(np.int64)
    times[highs] = 0
    start = max(state.high, 0) + (state.turns << 12)
    times |= np.repeat(np.append(np.int64(start), after_high), np.diff(highs, prepend=0, append=len(clock))) << 12
    # Cameras repeat the high time as they go, with no step back: only low times tell of one.
    times = held_stamps(times, state.last, notes, ~is_high)
    return clock, times, after._replace(last=int(times[-1]) if len(times) else state.last)


def _vector_starts(
    bases: UInt16[np.ndarray, " b"], before: Int64[np.ndarray, " b"], kind: UInt8[np.ndarray, " n"], state: State
) -> tuple[Int64[np.ndarray, " n"], Bool[np.ndarray, " n"], State]:
    """The leftmost pixel and the polarity of each mask. `before` counts the masks before each base."""
    width = np.where(kind == _VECTOR_12, 12, 8)
    ends = np.concatenate([[0], np.cumsum(width)])
    origin = _filled((bases & 0x7FF).astype(np.int64) - ends[before], before, len(kind), state.base_x)
    on = _filled((bases & 0x800) != 0, before, len(kind), bool(state.base_on))
    last = int(bases[-1] & 0x7FF) - int(ends[before[-1]]) if len(bases) else state.base_x
    last_on = int(bases[-1]) >> 11 & 1 if len(bases) else state.base_on
    # A base that only masks without end would move is no pixel any more; the state stays a small number.
    return origin + ends[:-1], on, state._replace(base_x=min(last + int(ends[-1]), 1 << 20), base_on=last_on)


@dataclass(frozen=True)
class Masks:
    """Words with a mask: its bits, how many are set, the pixel of its first bit, the polarity."""

    bits: UInt16[np.ndarray, " n"]
    counts: UInt8[np.ndarray, " n"]
    start: Int64[np.ndarray, " n"]
    is_on: Bool[np.ndarray, " n"]


def _columns_of(masks: Masks) -> tuple[Integer[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """x and polarity of all pixels in masks, in the order of the masks and of x."""
    bits = np.flatnonzero(np.unpackbits(masks.bits.view(np.uint8), bitorder="little"))
    # Bits are counted on from mask to mask, 16 in each.
    x = np.repeat(masks.start - 16 * np.arange(len(masks.start)), masks.counts)
    x += bits
    # A base that was moved beyond 16 bits is no pixel: the pixel is named as the events are collected.
    is_pixel = not len(masks.start) or int(masks.start.max()) < (1 << 16) - 16
    return x.astype(np.uint16) if is_pixel else x, np.repeat(masks.is_on, masks.counts)


def _with_masks(
    singles: UInt16[np.ndarray, " k"],
    ends_of_singles: Integer[np.ndarray, " k"],
    ends_of_masks: Integer[np.ndarray, " m"],
    masks: Masks,
) -> tuple[Integer[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """x and polarity of all events: masks and words with one pixel, each up to its end among the events."""
    x_of_masks, on_of_masks = _columns_of(masks)
    num = len(singles) + len(x_of_masks)
    if 2 * len(singles) < num:
        places = ends_of_singles - 1
        is_masked = np.ones(num, bool)
        is_masked[places] = False
        x, on = np.empty(num, x_of_masks.dtype), np.empty(num, bool)
        x[is_masked], on[is_masked] = x_of_masks, on_of_masks
        x[places], on[places] = singles & np.uint16(0x7FF), singles & np.uint16(0x800) != 0
        return x, on
    first = ends_of_masks - np.cumsum(masks.counts, dtype=np.int64)
    places = np.repeat(first, masks.counts) + np.arange(len(x_of_masks))
    is_single = np.ones(num, bool)
    is_single[places] = False
    pixels = np.empty(num, np.uint16)
    pixels[is_single] = singles
    x, on = (pixels & np.uint16(0x7FF)).astype(x_of_masks.dtype, copy=False), pixels & np.uint16(0x800) != 0
    x[places], on[places] = x_of_masks, on_of_masks
    return x, on


def _masks(words: UInt16[np.ndarray, " n"], kind: UInt8[np.ndarray, " n"]) -> UInt16[np.ndarray, " n"]:
    return words & np.where(kind == _VECTOR_12, np.uint16(0xFFF), np.uint16(0xFF))


def _filled(
    values: Shaped[np.ndarray, " m"], before: Integer[np.ndarray, " m"], num_events: int, start: int | bool
) -> Shaped[np.ndarray, " n"]:
    """Each event's last value, `start` before the first. `before` counts the events before each value."""
    counts = np.empty(len(values) + 1, np.int64)
    counts[:-1], counts[-1] = before, num_events
    counts[1:] -= before
    first = np.array([start], values.dtype)
    return np.repeat(np.concatenate([first, values]), counts)


def high_times(values: Shaped[np.ndarray, " m"], bits: int, state: State) -> tuple[Int64[np.ndarray, " m"], State]:
    """High times as ever growing ones, and the state after them."""
    counters = values.astype(np.int64)
    if len(counters) == 0:
        return counters, state
    steps = np.diff(counters, prepend=max(state.high, 0))
    turns = state.turns + np.cumsum(steps < -(1 << bits - 1))
    return counters + (turns << bits), state._replace(turns=int(turns[-1]), high=int(counters[-1]))


def timed_places(
    places: Int64[np.ndarray, " n"], highs: Int64[np.ndarray, " m"], state: State, notes: Notes
) -> Int64[np.ndarray, " k"]:
    """Without the event words before the stream's first high time."""
    if state.high >= 0:
        return places
    first = int(np.searchsorted(places, highs[0])) if len(highs) else len(places)
    notes.num_untimed += first
    return places[first:]


def held_stamps(
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
