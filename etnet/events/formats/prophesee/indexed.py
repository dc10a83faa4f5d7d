"""RAW files: a large one is gone through once for an index of its blocks, which is kept, and read by slice."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import BinaryIO

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.columns import LARGEST_STAMP
from etnet.events.formats.decode import Collected, Decoded, collect, stated_sensor
from etnet.events.formats.paged import check_slice
from etnet.events.formats.pixels import deduced_sensor
from etnet.events.formats.polarity import signed_polarity
from etnet.events.formats.prophesee.evt2_evt3 import Notes, State, Version
from etnet.events.formats.prophesee.header import Header
from etnet.events.formats.prophesee.index import Blocks, index_of
from etnet.events.formats.trigger_table import TriggerTable
from etnet.events.formats.unchanged import Unchanged
from etnet.events.index_store import Arrays
from etnet.events.recording import EventSource, Span

HELD_BYTES = 96 << 20
"""Decoded events that stay in memory."""

_BYTES_PER_EVENT = 13
_SOME_BLOCKS = 32

_FARTHEST_SLIP = 1_000_000
"""µs. Beyond it a step back is no slip of the camera's clock, …"""

_MOST_HELD = 0.01
"""… and where so large a share of the stamps would be held at the last one before, they would mean nothing."""


@dataclass(frozen=True)
class IndexedSource:
    """Events of the blocks that the index knows; the last few decoded blocks are kept."""

    request: Request
    blocks: Blocks
    file: BinaryIO
    unchanged: Unchanged
    index: Arrays
    t0: int
    sensor: Sensor
    _held: OrderedDict[int, Decoded] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    @property
    def num_events(self) -> int:
        """How many events there are."""
        return int(self.index["before"][-1])

    def bracket(self, t: int) -> tuple[int, int] | None:
        """The events of the block whose stamps reach `t`."""
        block = int(np.searchsorted(self.index["until"], t - self.t0))
        return int(self.index["before"][block]), int(self.index["before"][block + 1])

    def read(self, start: int, stop: int) -> Events:
        """Decode the blocks of a slice that are not at hand."""
        if start == stop:
            return Events.empty(self.sensor)
        before, name = self.index["before"], self.request.name
        first = int(np.searchsorted(before, start, "right")) - 1
        last = int(np.searchsorted(before, stop)) - 1
        with self._lock:
            parts = [self.block(i) for i in range(first, last + 1) if before[i + 1] > before[i]]
        span = slice(start - int(before[first]), stop - int(before[first]))
        x, y, t, p = (np.concatenate(column)[span] for column in list(zip(*parts, strict=True))[:4])
        pixels = x.astype(np.uint16, copy=False), y
        events = Events(*pixels, t + self.t0, signed_polarity(p, self.request.assume, name), self.sensor)
        check_slice(events, start, name)
        return events

    def block(self, i: int) -> Decoded:
        """All events of a block, from memory or the file."""
        if i in self._held:
            self._held.move_to_end(i)
            return self._held[i]
        state = State(*(int(value) for value in self.index["states"][i]))
        words = self.unchanged.during(lambda: self.blocks.words(self.file, i))
        decoded, _ = self.blocks.version.decode(words, state, Notes())
        if len(decoded.t) != self.index["before"][i + 1] - self.index["before"][i]:
            raise RecordingError(f"{self.request.name}: it is not the file any more that was indexed; open it again")
        self._held[i] = decoded
        while len(self._held) > 1 and sum(len(d.t) for d in self._held.values()) * _BYTES_PER_EVENT > HELD_BYTES:
            self._held.popitem(last=False)
        return decoded

    def close(self) -> None:
        """The file belongs to the request's resources."""


def open_indexed(
    request: Request, header: Header, version: Version, declared: Sensor | None, remarks: Remarks
) -> Collected:
    """The events by slice; the index from the cache folder, else made now as far as the request's patience goes."""
    unchanged = Unchanged(request)
    blocks, t0 = _blocks(request, header, version, remarks)
    index, growth = index_of(request, blocks, version.name, remarks)
    if index["before"][-1] == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    _say(index["notes"], int(index["before"][-1]), request.name, remarks)
    table = TriggerTable()
    table.add(*index["triggers"].T)
    file = request.resources.enter_context(request.path.open("rb"))
    sensor = stated_sensor(request, declared, remarks)
    source = IndexedSource(request, blocks, file, unchanged, index, t0, sensor or Sensor(1 << 16, 1 << 16))
    if sensor is None:
        sensor = _probed_sensor(source, request, remarks)
        source = replace(source, sensor=sensor)
    return Collected(source, sensor, _span(source), growth, table.triggers(remarks, t0))


def decode_all(
    request: Request, header: Header, version: Version, declared: Sensor | None, remarks: Remarks
) -> Collected:
    """The events of a small file, decoded at once."""
    blocks, t0 = _blocks(request, header, version, remarks)

    def parts() -> Iterator[tuple[np.ndarray, float]]:
        with request.path.open("rb") as file:
            for i in range(blocks.num_blocks):
                yield blocks.words(file, i), (i + 1) / blocks.num_blocks

    return decode_words(request, version, parts(), t0, declared, remarks)


def decode_words(
    request: Request,
    version: Version,
    parts: Iterable[tuple[np.ndarray, float]],
    t0: int,
    declared: Sensor | None,
    remarks: Remarks,
) -> Collected:
    """The events of words that come part by part, each part with the share of the file that it completes."""
    notes = Notes()

    def pieces() -> Iterator[Decoded]:
        state = State()
        for words, fraction in parts:
            decoded, state = version.decode(words, state, notes)
            yield decoded._replace(t=decoded.t + t0 if t0 else decoded.t, fraction=fraction)

    collected = collect(request, pieces(), declared, remarks)
    if collected.source.num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    told = np.array([notes.num_untimed, notes.num_held, notes.farthest_back])
    _say(told, collected.source.num_events, request.name, remarks)
    return replace(collected, triggers=notes.triggers.triggers(remarks, t0))


def _blocks(request: Request, header: Header, version: Version, remarks: Remarks) -> tuple[Blocks, int]:
    """The words after the header, and the stamp from which they count."""
    size = request.path.stat().st_size - header.num_bytes
    rest = size % version.word.itemsize
    if rest:
        remarks.repaired(f"{rest} bytes after the last whole word were left out; the file may be truncated")
    # faery's own key, which our writer uses too: the stamps count from there.
    t0 = header.fields.get("t0", "0")
    if not t0.isascii() or not t0.isdigit() or int(t0) >= LARGEST_STAMP:
        raise RecordingError(f'{request.name}: its header\'s t0 is "{t0[:40]}"; wanted a stamp in µs')
    return Blocks(request.path, version, header.num_bytes, size - rest), int(t0)


def _span(source: EventSource) -> Span:
    last = source.num_events - 1
    return Span(int(source.read(0, 1).t[0]), int(source.read(last, last + 1).t[0]))


def _say(notes: Int64[np.ndarray, " 3"], num_events: int, name: str, remarks: Remarks) -> None:
    num_untimed, num_held, farthest = (int(value) for value in notes)
    if farthest > _FARTHEST_SLIP and num_held > _MOST_HELD * num_events:
        raise RecordingError(
            f"{name}: time runs back by {farthest / 1e6:.1f} s and stays behind for {num_held:,} stamps: the clock "
            "restarts (several recordings in one file: cut it where each begins) or a time in it is damaged"
        )
    if num_untimed:
        remarks.repaired(f"{num_untimed} words before the stream's first time were left out")
    if num_held:
        remarks.repaired(f"time ran back by up to {farthest} µs; {num_held} stamps were held at the last one before")


def _probed_sensor(source: IndexedSource, request: Request, remarks: Remarks) -> Sensor:
    """What the events of some blocks, spread over the file, reach."""
    places = np.unique(np.linspace(0, len(source.index["until"]) - 1, _SOME_BLOCKS).astype(int))
    probes = [probe for probe in (source.block(int(i)) for i in places) if len(probe.t)]
    reach_x, reach_y = (max(int(column.max()) for column in columns) for columns in list(zip(*probes, strict=True))[:2])
    return deduced_sensor(reach_x, reach_y, request.name, remarks, "the events looked at")
