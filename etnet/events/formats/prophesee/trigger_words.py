"""Triggers put into an EVT 3.0 file whose events are written already."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Int64, UInt16

from etnet.events.formats.prophesee.clock import header_end
from etnet.events.formats.prophesee.evt2_evt3 import TRIGGER, Notes, State, clock_words
from etnet.events.triggers import Triggers
from etnet.files import replacing

_LOW, _HIGH = 0x6 << 12, 0x8 << 12
_BLOCK = 1 << 20
MOST_CHANNELS = 16
"""Inputs that a word can name."""


def put_triggers(path: Path, triggers: Triggers) -> None:
    """Put each trigger before the first time word that is later. Stamps count as the file's do, from 0 on.

    An edge that is not known is written as a rising one: the format has no other.
    """
    start = header_end(path)
    state, place, high = State(), 0, -1
    with replacing(path) as filled, path.open("rb") as source, filled.open("wb") as target:
        target.write(source.read(start))
        while block := source.read(2 * _BLOCK):
            words = np.frombuffer(block, "<u2")
            clock, times, state = clock_words(words, state, Notes())
            if len(times):
                # What comes after the block's last time may still come after a later one.
                first, place = place, int(np.searchsorted(triggers.stamps, times[-1]))
                words = _filled(words, clock, times, _part(triggers, first, place), high)
                high = int(times[-1]) >> 12
            words.tofile(target)
        no_words, no_times = np.empty(0, "<u2"), np.empty(0, np.int64)
        _filled(no_words, no_times, no_times, _part(triggers, place), high).tofile(target)


def _part(triggers: Triggers, start: int, stop: int | None = None) -> Triggers:
    span = slice(start, stop)
    return Triggers(triggers.stamps[span], triggers.channels[span], triggers.edges[span])


def _filled(
    words: UInt16[np.ndarray, " n"],
    clock: Int64[np.ndarray, " m"],
    times: Int64[np.ndarray, " m"],
    triggers: Triggers,
    high: int,
) -> UInt16[np.ndarray, " k"]:
    """The words with the triggers among them; `high` is the high time that held before the first word."""
    if len(triggers) == 0:
        return words
    count = np.searchsorted(times, triggers.stamps, "right")
    places = np.append(clock, len(words))[count]
    held = np.append(np.int64(high), times >> 12)[count]
    is_after_another = np.append(False, places[1:] == places[:-1])
    held[is_after_another] = (triggers.stamps >> 12)[:-1][is_after_another[1:]]
    put: list[int] = []
    bounds = [0]
    for stamp, channel, edge, before in zip(
        triggers.stamps.tolist(), triggers.channels.tolist(), triggers.edges.tolist(), held.tolist(), strict=True
    ):
        put += [] if stamp >> 12 == before else [_HIGH | (stamp >> 12) & 0xFFF]
        put += [_LOW | stamp & 0xFFF, TRIGGER << 12 | channel % MOST_CHANNELS << 8 | int(edge >= 0)]
        bounds.append(len(put))
    lengths = [stop - start for start, stop in pairwise(bounds)]
    return np.insert(words, np.repeat(places, lengths), np.array(put, "<u2"))
