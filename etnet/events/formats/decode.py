"""Formats with no index: decode once from front to back, mend what can be mended, keep the columns."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, Integer, Shaped

from etnet.errors import RecordingError
from etnet.events.cache import Columns, ColumnSource, EventCache
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.bounds import check_sensor
from etnet.events.formats.columns import (
    LARGEST_STAMP,
    deduced_sensor,
    is_ordered,
    pixel_column,
    say_coding,
    signed_polarity,
)
from etnet.events.recording import EventSource, Growth, Span

FEW = 0.01
"""The share of events beyond the sensor up to which they count as strays; if there are more, the size is wrong."""

SMALL_STEP_BACK = 1000
"""µs. Cameras' own clocks step back this little between packets; more is a fault that a person must decide about."""


class Decoded(NamedTuple):
    """A piece of a file: x, y and p of any number type, t already in whole µs."""

    x: Shaped[np.ndarray, " n"]
    y: Shaped[np.ndarray, " n"]
    t: Integer[np.ndarray, " n"]
    p: Shaped[np.ndarray, " n"]
    fraction: float = 0.0
    """How much of the file has been read after this piece, 0 … 1."""


@dataclass(frozen=True)
class Collected:
    """Events at rest."""

    source: EventSource
    sensor: Sensor
    span: Span
    growth: Growth | None = None


@dataclass
class _Order:
    """What was seen of the stamps' order so far."""

    last: int | None = None
    num_back: int = 0
    first_back: int = 0
    farthest: int = 0

    def look(self, t: Int64[np.ndarray, " n"], index: int, ordered: bool) -> None:
        """Take in a piece whose first event is number `index`; `ordered` if it never steps back within itself."""
        before = int(t[0]) if self.last is None else self.last
        self.last = int(t[-1])
        if ordered and t[0] >= before:
            return
        steps = np.diff(t, prepend=before)
        if self.num_back == 0:
            self.first_back = index + int(np.argmax(steps < 0))
        self.num_back += int(np.count_nonzero(steps < 0))
        self.farthest = max(self.farthest, -int(steps.min()))


@dataclass
class _Stray:
    """Events beyond the sensor, and how far any event reaches."""

    reach_x: int = -1
    reach_y: int = -1
    num_outside: int = 0
    first: int = 0

    def weed(self, columns: Columns, sensor: Sensor | None, index: int) -> int:
        """Move the events inside the sensor to the front of `columns`; how many they are."""
        count = len(columns.t)
        furthest_x, furthest_y = int(columns.x.max()), int(columns.y.max())
        self.reach_x, self.reach_y = max(self.reach_x, furthest_x), max(self.reach_y, furthest_y)
        if sensor is None or (furthest_x < sensor.width and furthest_y < sensor.height):
            return count
        inside = (columns.x < sensor.width) & (columns.y < sensor.height)
        kept = int(np.count_nonzero(inside))
        if self.num_outside == 0:
            self.first = index + int(np.argmin(inside))
        self.num_outside += count - kept
        for column in columns:
            column[:kept] = column[inside]
        return kept


def collect(request: Request, pieces: Iterable[Decoded], declared: Sensor | None, remarks: Remarks) -> Collected:
    """Decode all pieces into the cache. `declared` is the sensor as the file has it; a stated one wins over it."""
    cache = EventCache(request.scratch)
    sensor = stated_sensor(request, declared, remarks)
    order, stray, lowest = _Order(), _Stray(), 2
    for whole in pieces:
        if whole.p.dtype.kind in "iu":
            lowest = min(lowest, int(whole.p.min(initial=2)))
        for piece in _parts(whole, cache.capacity):
            columns = cache.room(len(piece.t))
            ordered = _fill(columns, piece, request, cache.num_events)
            kept = stray.weed(columns, sensor, cache.num_events)
            if kept:
                order.look(columns.t[:kept], cache.num_events, ordered)
            cache.keep(kept)
        request.progress(min(whole.fraction, 0.99))
    if sensor is None:
        if cache.num_events == 0:
            raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
        sensor = deduced_sensor(stray.reach_x, stray.reach_y, request.name, remarks)
    if lowest < 2 and request.assume.polarity != "positive":
        say_coding(lowest, False, remarks)
    _judge_outside(stray, cache.num_events, sensor, request, remarks)
    columns = _ordered(cache, order, request, remarks)
    request.progress(1.0)
    span = Span(int(columns.t[0]), int(columns.t[-1])) if len(columns.t) else Span(0, 0)
    return Collected(ColumnSource(columns, sensor), sensor, span)


def stated_sensor(request: Request, declared: Sensor | None, remarks: Remarks) -> Sensor | None:
    """The sensor a person states, else the one the file declares; an error for one with more pixels than allowed."""
    stated = request.assume.sensor
    sensor = declared if stated is None else stated
    if sensor is not None:
        check_sensor(sensor, request.name, request.assume.max_pixels)
    if stated is None:
        return declared
    was = f"; the file says {declared}" if declared is not None and declared != stated else ""
    remarks.assumed(f"sensor {stated}, as stated{was}")
    return stated


def _parts(piece: Decoded, capacity: int) -> Iterator[Decoded]:
    """The piece in parts that fit the cache; none of an empty one."""
    for start in range(0, len(piece.t), capacity):
        x, y, t, p, fraction = piece
        part = slice(start, start + capacity)
        yield Decoded(x[part], y[part], t[part], p[part], fraction)


def _fill(columns: Columns, piece: Decoded, request: Request, index: int) -> bool:
    """Put a piece where it stays; whether its stamps are in order."""
    columns.x[:] = pixel_column(piece.x, "x", request.name)
    columns.y[:] = pixel_column(piece.y, "y", request.name)
    signed_polarity(piece.p, request.assume, request.name, columns.p)
    # A stamp of 64 bits without a sign that does not fit becomes negative here, and is told by it.
    columns.t[:] = piece.t.view(np.int64) if piece.t.dtype == np.uint64 else piece.t
    ordered = is_ordered(columns.t)
    low, high = (columns.t[0], columns.t[-1]) if ordered else (columns.t.min(), columns.t.max())
    if low <= -LARGEST_STAMP or high >= LARGEST_STAMP or (low < 0 and piece.t.dtype.kind == "u"):
        raise RecordingError(f"{request.name}: stamps after event {index} are no time; the file is damaged there")
    return ordered


def _judge_outside(stray: _Stray, num_kept: int, sensor: Sensor, request: Request, remarks: Remarks) -> None:
    """A few stray events are dropped and said so; if they are many, the size or the format is wrong."""
    if stray.num_outside == 0:
        return
    num_all, reach = num_kept + stray.num_outside, f"up to ({stray.reach_x}, {stray.reach_y})"
    if not request.assume.drop_outside and stray.num_outside > FEW * num_all:
        raise RecordingError(
            f"{request.name}: {stray.num_outside} of {num_all} events lie beyond {sensor}, {reach}; state the size "
            "with --assume width=…,height=… or leave them out with --drop-outside"
        )
    remarks.repaired(
        f"{stray.num_outside} events beyond the sensor {sensor}, {reach}, were left out; "
        f"the first came before event {stray.first}"
    )


def _ordered(cache: EventCache, order: _Order, request: Request, remarks: Remarks) -> Columns:
    if order.num_back == 0:
        return cache.columns()
    if order.farthest > SMALL_STEP_BACK and not request.assume.sort:
        raise RecordingError(
            f"{request.name}: time runs back {order.num_back} times, first at event {order.first_back}, "
            f"by up to {order.farthest} µs; open it with --sort"
        )
    remarks.repaired(
        f"time ran back {order.num_back} times, first at event {order.first_back}, by up to {order.farthest} µs; "
        "the events were sorted by stamp"
    )
    return cache.sorted_columns()
