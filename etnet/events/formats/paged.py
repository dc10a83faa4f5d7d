"""Formats with an index: events stay in the file and are read in slices, each of them checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from threading import Lock

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.formats.base import Remarks, Request, contained
from etnet.events.formats.bounds import check_sensor
from etnet.events.formats.columns import is_ordered
from etnet.events.formats.decode import Collected, Decoded, collect, stated_sensor
from etnet.events.formats.pixels import advise_on_pixels, deduced_sensor, pixel_column
from etnet.events.formats.polarity import Coding, signed_polarity
from etnet.events.formats.stamp_index import StampIndex
from etnet.events.formats.survey import Survey
from etnet.events.recording import Span

LONG = 1 << 24
"""Events from which on a time index is worth its making; below, a dozen looks into the file find any moment."""

PAGE = 1 << 18
"""Events read at once when a whole file is gone through."""

SHORT = 1 << 22
"""Events up to which a file is looked through whole at opening: its order, its pixels, its polarity."""

_FEW_PROBES, _MANY_PROBES = 8, 64
_PROBE = 4096

ReadColumns = Callable[[int, int], Decoded]
"""Events start … stop − 1 as the file has them, t in µs."""


@dataclass(frozen=True)
class PagedSource:
    """Events in a file that can be read by slice. Every slice is checked: order, sensor, polarity."""

    request: Request
    what: str
    num_events: int
    sensor: Sensor
    read_columns: ReadColumns
    lock: Lock
    stamps: StampIndex | None = None
    coding: Coding | None = None

    def bracket(self, t: int) -> tuple[int, int] | None:
        """From the index of a long file, as soon as it is there."""
        return None if self.stamps is None else self.stamps.bracket(t)

    def read(self, start: int, stop: int) -> Events:
        """Read and convert one slice."""
        name = self.request.name
        with self.lock, contained(name, f"events {start} … {stop} of {self.what}"):
            raw = self.read_columns(start, stop)
        assume = self.request.assume
        x, y = pixel_column(raw.x, "x", name, assume.pixels), pixel_column(raw.y, "y", name, assume.pixels)
        signs = signed_polarity(raw.p, assume, name, coding=self.coding)
        events = Events(x, y, raw.t.astype(np.int64, copy=False), signs, self.sensor)
        if not len(raw.x) == len(raw.y) == len(raw.t) == len(raw.p) == stop - start:
            raise RecordingError(f"{name}: columns end before event {stop}; the file may be truncated")
        check_slice(events, start, name)
        return events

    def close(self) -> None:
        """The file belongs to the request's resources."""


def paged(
    request: Request,
    what: str,
    num_events: int,
    read_columns: ReadColumns,
    declared: Sensor | None,
    remarks: Remarks,
    read_stamps: Callable[[int, int], np.ndarray] | None = None,
) -> Collected:
    """A recording that stays in its file; where it has to be mended (as asked for, or as seen), it is loaded instead.

    A short file is looked through whole at opening, a long one in places. `read_stamps` reads t alone (µs); by
    default all columns are read for it.
    """
    if num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if request.assume.mends:
        return collect(request, pages(num_events, read_columns), declared, remarks)
    only_stamps = read_stamps or (lambda start, stop: read_columns(start, stop).t)
    sensor = request.assume.sensor or declared
    survey, is_short = Survey(request, sensor), num_events <= SHORT
    if is_short or sensor is None:
        for start, stop in _all(num_events) if is_short else _places(num_events, _MANY_PROBES):
            survey.look(start, read_columns(start, stop))
            if num_events > PAGE:
                request.progress(0.5 * stop / num_events)
    else:
        for start, stop in _places(num_events, _FEW_PROBES):
            survey.look_at_stamps(start, only_stamps(start, stop))
        survey.look_at_polarity(read_columns(0, min(num_events, _PROBE)).p)
    if survey.is_turning or (is_short and _is_easily_mended(survey)):
        return collect(request, pages(num_events, read_columns), declared, remarks)
    survey.check_order()
    sensor = _sensor_of(survey, declared, is_short, request, remarks)
    survey.check_polarity(remarks)
    span = Span(int(only_stamps(0, 1)[0]), int(only_stamps(num_events - 1, num_events)[0]))
    lock = Lock()
    stamps = None
    if num_events >= LONG:
        stamps = StampIndex(request, num_events, only_stamps, lock)
        request.resources.callback(stamps.stop)
    source = PagedSource(request, what, num_events, sensor, read_columns, lock, stamps, survey.coding)
    return Collected(source, sensor, span)


def _is_easily_mended(survey: Survey) -> bool:
    """A few strays, a few steps back of no account: nothing that has to be asked."""
    return survey.has_few_strays or (not survey.order.is_ordered and survey.order.is_small)


def _sensor_of(survey: Survey, declared: Sensor | None, is_all: bool, request: Request, remarks: Remarks) -> Sensor:
    sensor, reach = stated_sensor(request, declared, remarks), survey.reach
    is_too_far = reach.num_far > 0 if sensor is None else survey.has_strays
    if request.assume.pixels == "whole" and is_too_far and reach.is_fixed_point:
        raise RecordingError(f"{request.name}: {reach.fixed_point_fault()}")
    survey.check_strays()
    if sensor is None:
        where = "the events" if is_all else "the events looked at"
        sensor = deduced_sensor(*reach.on_sensor, request.name, remarks, where)
        check_sensor(sensor, request.name, request.assume.max_pixels)
        if request.assume.pixels == "whole":
            advise_on_pixels(reach, sensor, remarks)
    return sensor


def _all(num_events: int) -> list[tuple[int, int]]:
    return [(start, min(start + PAGE, num_events)) for start in range(0, num_events, PAGE)]


def pages(num_events: int, read_columns: ReadColumns) -> Iterator[Decoded]:
    """All events, a page at a time."""
    for start in range(0, num_events, PAGE):
        stop = min(start + PAGE, num_events)
        yield read_columns(start, stop)._replace(fraction=stop / num_events)


def _places(num_events: int, most: int) -> list[tuple[int, int]]:
    """A few short slices, spread over the file, first and last events among them."""
    last = max(0, num_events - _PROBE)
    starts = sorted({int(place) for place in np.linspace(0, last, min(most, 1 + num_events // _PROBE))} | {last})
    return [(start, min(start + _PROBE, num_events)) for start in starts]


def check_slice(events: Events, start: int, name: str) -> None:
    """An error that names the first event beyond the sensor, or before its predecessor."""
    if len(events) == 0:
        return
    if events.x.max() >= events.sensor.width or events.y.max() >= events.sensor.height:
        outside = (events.x >= events.sensor.width) | (events.y >= events.sensor.height)
        i = int(np.argmax(outside))
        raise RecordingError(
            f"{name}: event {start + i} is at ({events.x[i]}, {events.y[i]}), beyond {events.sensor}; "
            "state the size with --assume width=…,height=… or open it with --drop-outside"
        )
    _check_order(events.t, start, name)


def _check_order(t: Int64[np.ndarray, " n"], start: int, name: str) -> None:
    if is_ordered(t):
        return
    i = int(np.argmax(t[1:] < t[:-1])) + 1
    raise RecordingError(f"{name}: time runs back at event {start + i} ({t[i - 1]} > {t[i]} µs); open it with --sort")
