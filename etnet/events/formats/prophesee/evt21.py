"""Prophesee EVT 2.1: 64-bit words, each with a base pixel and a mask of 32 pixels to its right.

Layout: docs.prophesee.ai, "EVT 2.1 format": type 4 bits, low time 6, x 11, y 11, mask 32; type 8 carries the high 28
bits of the time, type 10 an edge on a trigger input. Cameras up to the IMX636 send the two halves of a word swapped, in
OpenEB's words "endianness legacy"; older headers and ROS packets do not say so. Readers that look only at "evt 2" take
it for EVT 2.0 and give twice the events, all wrong.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int64, UInt64

from etnet.events.formats.base import Remarks
from etnet.events.formats.decode import Decoded
from etnet.events.formats.prophesee.evt2_evt3 import (
    TRIGGER,
    Notes,
    State,
    Version,
    held_stamps,
    high_times,
    timed_places,
)
from etnet.events.formats.word_stream import set_bits

_HIGH = 8


def decode_evt21(words: UInt64[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    """The events of one block, those of a word in the order of x."""
    kind = (words >> np.uint64(60)).astype(np.uint8)
    highs, triggers = np.flatnonzero(kind == _HIGH), np.flatnonzero(kind == TRIGGER)
    places = timed_places(np.flatnonzero(kind < 2), highs, state, notes)
    times, after = high_times((words[highs] >> np.uint64(32)) & np.uint64(0xFFFFFFF), 28, state)
    since = np.append(np.int64(max(state.high, 0) + (state.turns << 28)), times)
    _note_triggers(words[triggers], since, np.searchsorted(highs, triggers), state, notes)
    picked = words[places]
    stamps = _stamps(picked, since[np.searchsorted(highs, places)])
    stamps = held_stamps(stamps, state.last, notes)
    rows, bits = set_bits((picked & np.uint64(0xFFFFFFFF)).astype(np.uint32))
    x = ((picked >> np.uint64(43)) & np.uint64(0x7FF)).astype(np.int64)[rows] + bits
    y = ((picked >> np.uint64(32)) & np.uint64(0x7FF)).astype(np.uint16)[rows]
    last = int(stamps[-1]) if len(stamps) else state.last
    return Decoded(x, y, stamps[rows], (kind[places] == 1)[rows]), after._replace(last=last)


def _decode_legacy(words: UInt64[np.ndarray, " n"], state: State, notes: Notes) -> tuple[Decoded, State]:
    return decode_evt21(_swapped(words), state, notes)


def _skim(words: UInt64[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    decoded, after = decode_evt21(words, state, notes)
    return len(decoded.t), after


def _skim_legacy(words: UInt64[np.ndarray, " n"], state: State, notes: Notes) -> tuple[int, State]:
    decoded, after = _decode_legacy(words, state, notes)
    return len(decoded.t), after


def _swapped(words: UInt64[np.ndarray, " n"]) -> UInt64[np.ndarray, " n"]:
    return (words << np.uint64(32)) | (words >> np.uint64(32))


EVT21 = Version("2.1", np.dtype("<u8"), decode_evt21, _skim)
EVT21_LEGACY = Version("2.1 legacy", np.dtype("<u8"), _decode_legacy, _skim_legacy)


def judged_version(content: bytes, what: str, remarks: Remarks) -> Version:
    """By the order of halves in which the times of these words ascend; said where they are swapped.

    `what` they are the words of.
    """
    words = np.frombuffer(content[: len(content) // 8 * 8], "<u8")
    if _share_forward(_swapped(words)) > _share_forward(words):
        remarks.assumed(f"the halves of {what}'s words are swapped: so their times ascend")
        return EVT21_LEGACY
    return EVT21


def _share_forward(words: UInt64[np.ndarray, " n"]) -> float:
    """Of the steps from one high time to a different one those forward, and nearer to a half the fewer there are.

    A mask in the place of a type may look like one of time: such times repeat, or go back as often as forward.
    """
    times = (words[words >> np.uint64(60) == _HIGH] >> np.uint64(32)).astype(np.int64)
    steps = np.diff(times, prepend=0)
    forward, back = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
    return (forward + 1) / (forward + back + 2)


def _stamps(words: UInt64[np.ndarray, " n"], high: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    return high << 6 | ((words >> np.uint64(54)) & np.uint64(0x3F)).astype(np.int64)


def _note_triggers(
    words: UInt64[np.ndarray, " n"],
    since: Int64[np.ndarray, " m"],
    before: Int64[np.ndarray, " n"],
    state: State,
    notes: Notes,
) -> None:
    """Bits 44–40 are the input's number, bit 32 tells a rising edge. `before` counts the high times before each."""
    is_timed = (before > 0) | (state.high >= 0)
    channels = ((words >> np.uint64(40)) & np.uint64(0x1F)).astype(np.int16)
    edges = ((words >> np.uint64(32)) & np.uint64(1)).astype(np.int8) * 2 - 1
    notes.triggers.add(_stamps(words, since[before])[is_timed], channels[is_timed], edges[is_timed])
