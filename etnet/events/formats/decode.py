"""Formats with no index: decode once from front to back, mend what can be mended, keep the columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Integer, Shaped

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.cache import Columns, ColumnSource, EventCache
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks, Request
from etnet.events.formats.bounds import check_sensor
from etnet.events.formats.columns import LARGEST_STAMP, is_ordered
from etnet.events.formats.pixels import (
    FEW,
    Reach,
    advise_on_pixels,
    deduced_sensor,
    is_far,
    is_size_of_events,
    odd_pixels,
    placed,
)
from etnet.events.formats.polarity import Coding, say_coding, say_unusual, signed_polarity, unusual_coding
from etnet.events.formats.stamp_order import StampOrder
from etnet.events.formats.time_unit import PER_SECOND, Evidence
from etnet.events.formats.wrapping_clock import WrappingClock
from etnet.events.recording import EventSource, Growth, Span
from etnet.events.triggers import Triggers

LOOKED_AT = 1 << 20
"""Stamps by which it is judged how fine they are."""


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
    triggers: Triggers | None = None


@dataclass
class _Strays:
    """Events that lie beyond the sensor or nowhere at all."""

    reach: Reach
    num_outside: int = 0
    first: int = 0

    def weed(self, columns: Columns, nowhere: np.ndarray | None, sensor: Sensor | None, index: int) -> int:
        """Move the events inside the sensor to the front of `columns`; how many they are."""
        count = len(columns.t)
        inside = None if nowhere is None else ~nowhere
        somewhere = (columns.x, columns.y) if inside is None else (columns.x[inside], columns.y[inside])
        self.reach.look(*somewhere)
        if sensor is not None and (self.reach.high_x >= sensor.width or self.reach.high_y >= sensor.height):
            on_it = (columns.x < sensor.width) & (columns.y < sensor.height)
            inside = on_it if inside is None else inside & on_it
        elif sensor is None and self.reach.num_far:
            near = ~is_far(columns.x, columns.y)
            inside = near if inside is None else inside & near
        if inside is None or inside.all():
            return count
        kept = int(np.count_nonzero(inside))
        if self.num_outside == 0:
            self.first = index + int(np.argmin(inside))
        self.num_outside += count - kept
        for column in columns:
            column[:kept] = column[inside]
        return kept


@dataclass
class _Filling:
    """Turns pieces into columns that stay; what it learns of the clock and the polarity serves the next ones."""

    request: Request
    clock: WrappingClock
    coding: Coding | None = None
    lowest: float = 2
    is_first: bool = True

    def fill(self, columns: Columns, piece: Decoded, index: int) -> tuple[bool, np.ndarray | None]:
        """Put a piece where it stays; whether its stamps are in order, and which events lie nowhere."""
        name = self.request.name
        x, y, nowhere = placed(piece.x, piece.y, self.request.assume.pixels, name)
        columns.x[:], columns.y[:] = x, y
        if self.is_first and piece.p.dtype.kind in "iuf" and len(piece.p):
            self.is_first, self.coding = False, unusual_coding(piece.p.min().item(), piece.p.max().item())
        signed_polarity(piece.p, self.request.assume, name, columns.p, coding=self.coding)
        # A stamp of 64 bits without a sign that does not fit becomes negative here, and is told by it.
        stamps = piece.t.view(np.int64) if piece.t.dtype == np.uint64 else piece.t
        columns.t[:] = stamps
        ordered = is_ordered(columns.t)
        low, high = (columns.t[0], columns.t[-1]) if ordered else (columns.t.min(), columns.t.max())
        if low <= -LARGEST_STAMP or high >= LARGEST_STAMP or (low < 0 and piece.t.dtype.kind == "u"):
            raise RecordingError(f"{name}: stamps after event {index} are no time; the file is damaged there")
        unrolled = self.clock.unrolled(columns.t, ordered)
        if unrolled is not columns.t:
            columns.t[:] = unrolled
            ordered = is_ordered(columns.t)
        return ordered, nowhere


def collect(
    request: Request,
    pieces: Iterable[Decoded],
    declared: Sensor | None,
    remarks: Remarks,
    unit: Callable[[Evidence], TimeUnit] | None = None,
    taken: TimeUnit = "us",
    frames: Sensor | None = None,
) -> Collected:
    """Decode all pieces into the cache. `declared` is the sensor as the file has it; a stated one wins over it.

    `frames` is the size of the camera's pictures, which is that of the sensor where nothing speaks against it.
    `unit` judges, once all events are known, what their stamps count, which were taken to count `taken`.
    """
    cache = EventCache(request.scratch)
    sensor = stated_sensor(request, declared, remarks)
    order, strays, filling = StampOrder(), _Strays(Reach()), _Filling(request, WrappingClock())
    for whole in pieces:
        if whole.p.dtype.kind in "iu":
            filling.lowest = min(filling.lowest, int(whole.p.min(initial=2)))
        for piece in _parts(whole, cache.capacity):
            columns = cache.room(len(piece.t))
            ordered, nowhere = filling.fill(columns, piece, cache.num_events)
            kept = strays.weed(columns, nowhere, sensor, cache.num_events)
            if kept:
                # The only steps back may have been those of events that are gone.
                ordered = ordered or (kept < len(columns.t) and is_ordered(columns.t[:kept]))
                order.look(columns.t[:kept], cache.num_events, ordered)
            cache.keep(kept)
        request.progress(min(whole.fraction, 0.99))
    sensor = _sensor_of(strays, sensor, frames, cache.num_events, request, remarks)
    if filling.coding is not None and request.assume.polarity != "positive":
        say_unusual(filling.coding, remarks)
    elif filling.lowest < 2 and request.assume.polarity != "positive":
        say_coding(filling.lowest, False, remarks)
    if unit is not None and order.first is not None:
        filling.clock.say(remarks, _rescale(cache, order, sensor, unit, taken))
    else:
        filling.clock.say(remarks)
    columns = _ordered(cache, order, request, remarks)
    request.progress(1.0)
    span = Span(int(columns.t[0]), int(columns.t[-1])) if len(columns.t) else Span(0, 0)
    return Collected(ColumnSource(columns, sensor), sensor, span)


def _rescale(
    cache: EventCache, order: StampOrder, sensor: Sensor, unit: Callable[[Evidence], TimeUnit], taken: TimeUnit
) -> TimeUnit:
    """Turn stamps that were taken for `taken` into what they are found to be; exact, for units are powers of ten.

    Gives the unit in which a clock that wraps counted: µs as long as they are taken at their word.
    """
    per_microsecond = PER_SECOND[taken] / 10**6
    first, last = (stamp * per_microsecond for stamp in (order.first or 0, order.highest))
    is_fine = taken == "s" and bool((cache.columns().t[:LOOKED_AT] % 1000).any())
    found = unit(Evidence(cache.num_events, first, last, sensor.num_pixels, taken == "s", is_fine))
    if found == taken:
        return "us"
    up, down = PER_SECOND[taken], PER_SECOND[found]
    cache.map_stamps(lambda t: t * (up // down) if up >= down else _divided(t, down // up))
    order.scale(up / down)
    return found if taken == "us" else "us"


def _divided(t: np.ndarray, by: int) -> np.ndarray:
    """Rounded half to even."""
    whole, rest = np.divmod(t, by)
    return whole + ((2 * rest > by) | ((2 * rest == by) & ((whole & 1) == 1)))


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


def _sensor_of(
    strays: _Strays,
    sensor: Sensor | None,
    frames: Sensor | None,
    num_kept: int,
    request: Request,
    remarks: Remarks,
) -> Sensor:
    reach = strays.reach
    is_whole = request.assume.pixels == "whole"
    too_far = reach.num_far > 0 if sensor is None else strays.num_outside > 0
    if is_whole and too_far and reach.is_fixed_point:
        raise RecordingError(f"{request.name}: {reach.fixed_point_fault()}")
    if sensor is None:
        if num_kept == 0 and not reach.num_far:
            raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
        if frames is not None and is_size_of_events(reach, frames):
            remarks.detected(f"sensor {frames}, the size of the pictures")
            return frames
        sensor = deduced_sensor(*reach.on_sensor, request.name, remarks)
        check_sensor(sensor, request.name, request.assume.max_pixels)
        if is_whole:
            advise_on_pixels(reach, sensor, remarks)
    _judge_outside(strays, num_kept, sensor, request, remarks)
    return sensor


def _judge_outside(strays: _Strays, num_kept: int, sensor: Sensor, request: Request, remarks: Remarks) -> None:
    """A few stray events are dropped and said so; if they are many, the size or the format is wrong."""
    if strays.num_outside == 0:
        return
    num_all, reach = num_kept + strays.num_outside, f"up to ({strays.reach.high_x}, {strays.reach.high_y})"
    is_many, odd = strays.num_outside > FEW * num_all, odd_pixels(strays.reach, sensor)
    if is_many and not request.assume.drop_outside:
        raise RecordingError(
            f"{request.name}: {strays.num_outside} of {num_all} events lie beyond {sensor}, {reach}; state the size "
            f"with --assume width=…,height=… or leave them out with --drop-outside{odd and f'; {odd}'}"
        )
    if odd:
        remarks.advise(odd)
    if is_many:
        remarks.advise(
            f"--drop-outside left out {strays.num_outside:,} of {num_all:,} events "
            f"({strays.num_outside / num_all:.1%}): is the sensor really {sensor}?"
        )
    remarks.repaired(
        f"{strays.num_outside} events beyond the sensor {sensor}, {reach}, were left out; "
        f"the first came before event {strays.first}"
    )


def _ordered(cache: EventCache, order: StampOrder, request: Request, remarks: Remarks) -> Columns:
    if order.is_ordered:
        return cache.columns()
    if not order.is_small and not request.assume.sort:
        raise RecordingError(f"{request.name}: {order.fault()}")
    remarks.repaired(order.repair())
    if order.is_restarted and not order.is_small:
        remarks.advise(
            f"{order.num_back + 1} recordings of a clock that was restarted seem to lie one after another, and sorting "
            "mixed them; cut the file where the clock restarts"
        )
    return cache.sorted_columns()
