"""Columns, wherever they lie, become a recording: what their numbers mean is judged here, once for all containers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from etnet.errors import RecordingError
from etnet.events.assumptions import TimeUnit
from etnet.events.events import Sensor
from etnet.events.formats.base import Opened, Remarks, Request
from etnet.events.formats.column_finder import Column, Columns, check_lengths
from etnet.events.formats.columns import LARGEST_STAMP, stamps_in_microseconds
from etnet.events.formats.decode import Decoded
from etnet.events.formats.frames import Frames, attached
from etnet.events.formats.paged import PAGE, SHORT, paged
from etnet.events.formats.pixels import Reach, is_size_of_events, placed
from etnet.events.formats.time_unit import Evidence, judged_unit
from etnet.events.formats.wrapping_clock import WrappingClock

_PROBE, _PROBES = 4096, 16
_DAY = 86_400 * 10**6
_COARSE = {np.dtype(np.float32): 2**24 / 100, np.dtype(np.float16): 0.0}
"""Floats that hold stamps up to here alone."""


@dataclass(frozen=True)
class Table:
    """The columns of a file and what its layout says of them.

    `fixed`: the unit that the format fixes; `settled`: the one that it or a column's name states, unless a person
    states another; `usual`: the one that the layout has by convention.
    `offset`: µs that are added to all stamps. `kind`: the layout in plain words.
    """

    kind: str
    columns: Columns
    sensor: Sensor | None = None
    fixed: TimeUnit | None = None
    settled: TimeUnit | None = None
    usual: TimeUnit | None = None
    offset: int = 0
    frames: Frames | None = None
    may_count_from_one: bool = False


@dataclass(frozen=True)
class _Less:
    """A column whose numbers are all smaller by one than they are stored."""

    stored: Column

    def __len__(self) -> int:
        return len(self.stored)

    def __getitem__(self, part: slice) -> np.ndarray:
        return np.asarray(self.stored[part]) - 1


@dataclass(frozen=True)
class _Seconds:
    """µs as seconds."""

    stored: np.ndarray

    def __len__(self) -> int:
        return len(self.stored)

    def __getitem__(self, part: slice) -> np.ndarray:
        return self.stored[part] / 1e6


def open_table(request: Request, table: Table, remarks: Remarks) -> Opened:
    """A recording that stays where its columns are."""
    num_events = check_lengths(table.columns, request.name)
    if num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    x, y, t, p = (table.columns[axis] for axis in "xytp")
    if table.may_count_from_one and request.assume.pixels == "whole" and _count_from_one(x, y):
        x, y = _Less(x), _Less(y)
        remarks.assumed("pixels count from 1, as MATLAB does (none is 0), and were moved by one")
    declared = table.sensor
    if declared is None and table.frames is not None and request.assume.sensor is None:
        declared = _size_of_frames(table.frames, x, y, request, remarks)
    _advise_on_resolution(np.asarray(t[num_events - 1 :]), remarks)
    look, clock = _look(t), WrappingClock()
    if look.falls:
        t, clock = _unrolled(t, request)
        look = _look(t) if clock.turns else look
    unit = _unit(table, look, _num_pixels(x, y, declared, request), request, remarks)
    clock.say(remarks, "us" if isinstance(t, _Seconds) else unit)
    offset = _offset(table, t, unit, remarks)

    def stamps(start: int, stop: int) -> np.ndarray:
        return stamps_in_microseconds(np.asarray(t[start:stop]), unit, request.name, offset)

    def read(start: int, stop: int) -> Decoded:
        return Decoded(
            np.asarray(x[start:stop]), np.asarray(y[start:stop]), stamps(start, stop), np.asarray(p[start:stop])
        )

    collected = paged(request, table.kind, num_events, read, declared, remarks, stamps)
    truth = attached(table.frames, collected.span, request.assume.time_unit, request.name, remarks)
    return Opened(table.kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)


def places_of(num_events: int, whole: bool = False) -> list[slice]:
    """All of a short column by pages; of a long one some slices from its first to its last."""
    if whole or num_events <= SHORT:
        return [slice(start, min(start + PAGE, num_events)) for start in range(0, num_events, PAGE)]
    starts = np.linspace(0, num_events - _PROBE, _PROBES).astype(int).tolist()
    return [slice(start, start + _PROBE) for start in starts]


def _count_from_one(x: Column, y: Column) -> bool:
    return all(
        bool((np.asarray(column[part]) >= 1).all()) for column in (x, y) for part in places_of(len(column), True)
    )


def _size_of_frames(frames: Frames, x: Column, y: Column, request: Request, remarks: Remarks) -> Sensor | None:
    """The pictures' size, if it is that of the events looked at: another camera may have taken them."""
    if not is_size_of_events(_reach(x, y, request), frames.size):
        return None
    remarks.detected(f"sensor {frames.size}, the size of the frames")
    return frames.size


def _reach(x: Column, y: Column, request: Request) -> Reach:
    reach = Reach()
    for part in places_of(len(x)):
        there = placed(np.asarray(x[part]), np.asarray(y[part]), request.assume.pixels, request.name)
        kept = slice(None) if there.nowhere is None else ~there.nowhere
        reach.look(there.x[kept], there.y[kept])
    return reach


def _num_pixels(x: Column, y: Column, declared: Sensor | None, request: Request) -> int:
    sensor = request.assume.sensor or declared
    if sensor is not None:
        return sensor.num_pixels
    reach = _reach(x, y, request)
    return (reach.high_x + 1) * (reach.high_y + 1)


def _unit(table: Table, look: _Look, num_pixels: int, request: Request, remarks: Remarks) -> TimeUnit:
    if table.fixed is not None:
        return table.fixed
    if table.settled is not None and request.assume.time_unit is None:
        return table.settled
    return judged_unit(
        look.evidence(len(table.columns["t"]), num_pixels), request.assume, remarks, table.usual, table.kind
    )


def _unrolled(t: Column, request: Request) -> tuple[Column, WrappingClock]:
    """The column with stamps that go on where a clock of fewer bits wrapped; as it is where none did."""
    for scale in (1, 10**6) if np.asarray(t[:1]).dtype.kind == "f" else (1,):
        clock, path = WrappingClock(), request.scratch.path("t.unrolled", 8 * len(t))
        with path.open("wb") as file:
            for part in places_of(len(t), whole=True):
                numbers = np.asarray(t[part])
                if numbers.dtype.kind == "f":
                    if not bool((np.abs(numbers) < LARGEST_STAMP / scale).all()):
                        return t, WrappingClock()
                    numbers = numbers.astype(np.float64) * scale
                    if scale == 1 and bool((numbers != np.rint(numbers)).any()):
                        break
                    numbers = np.rint(numbers)
                clock.unrolled(numbers.astype(np.int64)).tofile(file)
            else:
                if clock.turns:
                    whole = np.memmap(path, np.int64, "r")
                    return whole if scale == 1 else _Seconds(whole), clock
    return t, WrappingClock()


@dataclass
class _Look:
    """What is seen of the stamps, all of a short column, some of a long one; the earliest need not be the first."""

    lowest: float = np.inf
    highest: float = -np.inf
    before: float = -np.inf
    falls: bool = False
    has_fractions: bool = False
    is_fine: bool = False

    def take(self, values: np.ndarray) -> None:
        """Take in a piece."""
        if values.dtype.kind == "f":
            values = values[np.isfinite(values)]
            self.has_fractions = self.has_fractions or bool((values != np.rint(values)).any())
            self.is_fine = self.is_fine or _is_finer_than_thousandths(values)
        if len(values) and values.dtype.kind in "iuf":
            runs_back = bool(values[0] < self.before) or bool((values[1:] < values[:-1]).any())
            self.falls, self.before = self.falls or runs_back, values[-1]
            self.lowest, self.highest = min(self.lowest, float(values.min())), max(self.highest, float(values.max()))

    def evidence(self, num_events: int, num_pixels: int) -> Evidence:
        """What tells the unit."""
        first, last = (self.lowest, self.highest) if self.lowest <= self.highest else (0.0, 0.0)
        return Evidence(num_events, first, last, num_pixels, self.has_fractions, self.is_fine)


def _look(t: Column) -> _Look:
    look = _Look()
    for part in places_of(len(t)):
        look.take(np.asarray(t[part]))
    return look


def _is_finer_than_thousandths(values: np.ndarray) -> bool:
    scaled = values.astype(np.float64) * 1000
    slack = np.spacing(np.abs(values)).astype(np.float64) * 2000 + 1e-6
    return bool((np.abs(scaled - np.rint(scaled)) > slack).any())


def _advise_on_resolution(values: np.ndarray, remarks: Remarks) -> None:
    """Floats of 32 bits hold no late stamps, those of 16 none at all: say how coarse they are at the end."""
    last = values[-1:]
    if last.dtype not in _COARSE or not np.isfinite(last[0]) or abs(float(last[0])) < _COARSE[last.dtype]:
        return
    step = float(np.spacing(np.abs(last[0])))
    remarks.advise(
        f"stamps are floats of {8 * last.dtype.itemsize} bits, which near {float(last[0]):.9g} resolve steps of "
        f"{step:g} only; events closer than that share a stamp: save them with 64 bits"
    )


def _offset(table: Table, t: Column, unit: TimeUnit, remarks: Remarks) -> int:
    """What has to be added to the stamps; nothing where they have it in them already."""
    if table.offset == 0:
        return 0
    first = stamps_in_microseconds(np.asarray(t[:1]), unit, table.kind)
    if abs(table.offset) > _DAY and len(first) and 0 <= int(first[0]) - table.offset < _DAY:
        remarks.assumed(f"t_offset, {table.offset} µs, is in the stamps already and was not added")
        return 0
    if abs(table.offset) >= LARGEST_STAMP:
        raise RecordingError(f"t_offset is {table.offset}; wanted one whole number of µs")
    return table.offset
