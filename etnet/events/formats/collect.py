"""Formats with no index: decode once from front to back, mend what can be mended, keep the columns."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Int64, Shaped

from etnet.errors import RecordingError
from etnet.events.cache import Columns, ColumnSource, EventCache
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.columns import deduced_sensor, pixel_column, signed_polarity
from etnet.events.recording import EventSource, Span

SMALL_STEP_BACK = 1000
"""µs. Cameras' own clocks step back this little between packets; more is a fault that a person must decide about."""


class Decoded(NamedTuple):
    """A piece of a file: x, y and p of any number type, t already int64 µs."""

    x: Shaped[np.ndarray, " n"]
    y: Shaped[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Shaped[np.ndarray, " n"]
    fraction: float = 0.0
    """How much of the file has been read after this piece, 0 … 1."""


@dataclass(frozen=True)
class Collected:
    """Events at rest."""

    source: EventSource
    sensor: Sensor
    span: Span


@dataclass
class _Order:
    """What was seen of the stamps' order so far."""

    last: int | None = None
    num_back: int = 0
    first_back: int = 0
    farthest: int = 0

    def look(self, t: Int64[np.ndarray, " n"], index: int) -> None:
        """Take in a piece whose first event is number `index`."""
        if len(t) == 0:
            return
        before = t[0] if self.last is None else self.last
        steps = np.diff(t, prepend=before)
        if int(steps.min()) < 0:
            if self.num_back == 0:
                self.first_back = index + int(np.argmax(steps < 0))
            self.num_back += int(np.count_nonzero(steps < 0))
            self.farthest = max(self.farthest, -int(steps.min()))
        self.last = int(t[-1])


def collect(request: Request, pieces: Iterable[Decoded], declared: Sensor | None, remarks: Remarks) -> Collected:
    """Decode all pieces into the cache. `declared` is the sensor as the file has it; a stated one wins over it."""
    cache = EventCache(request.scratch)
    sensor = stated_sensor(request, declared, remarks)
    order, reach_x, reach_y, num_outside, first_outside = _Order(), -1, -1, 0, 0
    for piece in pieces:
        columns = _unified(piece, request)
        if len(columns.t) == 0:
            continue
        reach_x, reach_y = max(reach_x, int(columns.x.max())), max(reach_y, int(columns.y.max()))
        if sensor is not None and (reach_x >= sensor.width or reach_y >= sensor.height):
            inside = (columns.x < sensor.width) & (columns.y < sensor.height)
            missing = len(inside) - int(np.count_nonzero(inside))
            if missing and num_outside == 0:
                first_outside = cache.num_events + int(np.argmin(inside))
            num_outside += missing
            columns = Columns(*(column[inside] for column in columns))
        order.look(columns.t, cache.num_events)
        cache.append(columns)
        request.progress(min(piece.fraction, 0.99))
    if sensor is None:
        if cache.num_events == 0:
            raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
        sensor = deduced_sensor(reach_x, reach_y, request.name, remarks)
    _judge_outside(num_outside, first_outside, cache.num_events, reach_x, reach_y, sensor, request, remarks)
    columns = _ordered(cache, order, request, remarks)
    request.progress(1.0)
    span = Span(int(columns.t[0]), int(columns.t[-1])) if len(columns.t) else Span(0, 0)
    return Collected(ColumnSource(columns, sensor), sensor, span)


def stated_sensor(request: Request, declared: Sensor | None, remarks: Remarks) -> Sensor | None:
    """The sensor a person states, else the one the file declares."""
    stated = request.assume.sensor
    if stated is None:
        return declared
    was = f"; the file says {declared}" if declared is not None and declared != stated else ""
    remarks.assumed(f"sensor {stated}, as stated{was}")
    return stated


def _unified(piece: Decoded, request: Request) -> Columns:
    return Columns(
        pixel_column(piece.x, "x", request.name),
        pixel_column(piece.y, "y", request.name),
        piece.t,
        signed_polarity(piece.p, request.assume, request.name),
    )


def _judge_outside(
    num_outside: int,
    first: int,
    num_kept: int,
    reach_x: int,
    reach_y: int,
    sensor: Sensor,
    request: Request,
    remarks: Remarks,
) -> None:
    """A few stray events are dropped and said so; if they are many, the size or the format is wrong."""
    if num_outside == 0:
        return
    if not request.assume.drop_outside and num_outside > 0.01 * (num_kept + num_outside):
        raise RecordingError(
            f"{request.name}: {num_outside} of {num_kept + num_outside} events lie beyond {sensor}, "
            f"up to ({reach_x}, {reach_y}); state the size with "
            "--assume width=…,height=… or leave them out with --drop-outside"
        )
    remarks.repaired(
        f"{num_outside} events beyond the sensor {sensor}, up to ({reach_x}, {reach_y}), were left out; "
        f"the first came before event {first}"
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
