"""Prophesee EVT 2.1: 64-bit words, each with a base pixel and a mask of 32 pixels to its right.

Layout: docs.prophesee.ai, "EVT 2.1 format": type 4 bits, low time 6, x 11, y 11, mask 32; type 8 carries the high 28
bits of the time. With the header's "endianness legacy" the two halves of a word are swapped. Decoded here because
readers that look only at "evt 2" take it for EVT 2.0 and give twice the events, all wrong.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from etnet.events.formats.base import Opened, Remarks, Request
from etnet.events.formats.decode import Decoded, collect
from etnet.events.formats.prophesee.header import CLOCK_PERIOD, Header, tell_turns
from etnet.events.formats.trigger_table import TriggerTable
from etnet.events.formats.word_stream import held, set_bits, unrolled

_NEGATIVE, _POSITIVE, _TIME_HIGH, _TRIGGER = 0x0, 0x1, 0x8, 0xA
_BLOCK = 1 << 16


def open_evt21(request: Request, header: Header) -> Opened:
    """Decode the whole file."""
    remarks = Remarks()
    declared = header.sensor(request.name, remarks, request.assume.sensor is not None)
    size = request.path.stat().st_size - header.num_bytes
    if size % 8:
        remarks.repaired(f"{size % 8} bytes after the last whole word were left out; the file may be truncated")
    is_legacy = header.fields.get("endianness", "little") == "legacy"
    table = TriggerTable()
    collected = collect(request, _pieces(request, header, size // 8, is_legacy, table), declared, remarks)
    tell_turns(collected, remarks)
    triggers = table.triggers(remarks)
    kept = tuple(remarks.kept)
    return Opened("Prophesee EVT2.1", collected.source, collected.sensor, collected.span, kept, triggers=triggers)


def _pieces(
    request: Request, header: Header, num_words: int, is_legacy: bool, table: TriggerTable
) -> Iterator[Decoded]:
    high, last, turns, is_started = 0, None, 0, False
    with request.path.open("rb") as file:
        file.seek(header.num_bytes)
        done = 0
        while done < num_words and (block := file.read(8 * min(_BLOCK, num_words - done))):
            words = np.frombuffer(block[: len(block) // 8 * 8], "<u8")
            done += len(words)
            if is_legacy:
                words = (words << np.uint64(32)) | (words >> np.uint64(32))
            kind = (words >> np.uint64(60)).astype(np.uint8)
            is_high = kind == _TIME_HIGH
            highs = ((words >> np.uint64(32)) & np.uint64(0x0FFFFFFF)).astype(np.int64)
            times = (held(highs, is_high, high) << 6) | ((words >> np.uint64(54)) & np.uint64(0x3F)).astype(np.int64)
            # Words before the first high time have no time at all.
            chosen = (kind == _NEGATIVE) | (kind == _POSITIVE) | (kind == _TRIGGER)
            if not is_started and bool(is_high.any()):
                chosen[: int(np.argmax(is_high))] = False
                is_started = True
            elif not is_started:
                chosen[:] = False
            if bool(is_high.any()):
                high = int(highs[np.flatnonzero(is_high)[-1]])
            picked, stamps = words[chosen], times[chosen]
            last_raw = int(stamps[-1]) if len(stamps) else last
            stamps, turns = unrolled(stamps, CLOCK_PERIOD, last, turns)
            last = last_raw
            is_event = kind[chosen] != _TRIGGER
            _note_triggers(picked[~is_event], stamps[~is_event], table)
            picked, stamps, on = picked[is_event], stamps[is_event], (kind[chosen] == _POSITIVE)[is_event]
            rows, bits = set_bits((picked & np.uint64(0xFFFFFFFF)).astype(np.uint32))
            x = ((picked >> np.uint64(43)) & np.uint64(0x7FF)).astype(np.int64)[rows] + bits
            y = ((picked >> np.uint64(32)) & np.uint64(0x7FF)).astype(np.uint16)[rows]
            yield Decoded(x, y, stamps[rows], on[rows], done / num_words)


def _note_triggers(words: np.ndarray, stamps: np.ndarray, table: TriggerTable) -> None:
    """Bits 44–40 are the input's number, bit 32 tells a rising edge."""
    channels = (words >> np.uint64(40)) & np.uint64(0x1F)
    edges = ((words >> np.uint64(32)) & np.uint64(1)).astype(np.int8) * 2 - 1
    table.add(stamps, channels, edges)
