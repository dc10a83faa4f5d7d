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
from etnet.events.formats.columns import deduced_sensor, is_ordered, pixel_column, say_coding, signed_polarity
from etnet.events.formats.decode import Collected, Decoded, collect, stated_sensor
from etnet.events.formats.stamp_index import StampIndex
from etnet.events.recording import Span

LONG = 1 << 24
"""Events from which on a time index is worth its making; below, a dozen looks into the file find any moment."""

PAGE = 1 << 18
"""Events read at once when a whole file is gone through."""

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

    def bracket(self, t: int) -> tuple[int, int] | None:
        """From the index of a long file, as soon as it is there."""
        return None if self.stamps is None else self.stamps.bracket(t)

    def read(self, start: int, stop: int) -> Events:
        """Read and convert one slice."""
        name = self.request.name
        with self.lock, contained(name, f"events {start} … {stop} of {self.what}"):
            raw = self.read_columns(start, stop)
        x, y = pixel_column(raw.x, "x", name), pixel_column(raw.y, "y", name)
        events = Events(
            x, y, raw.t.astype(np.int64, copy=False), signed_polarity(raw.p, self.request.assume, name), self.sensor
        )
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
    """A recording that stays in its file; with `--sort` or `--drop-outside` it is loaded and mended instead.

    `read_stamps` reads t alone (µs); by default all columns are read for it.
    """
    if num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if request.assume.mends:
        return collect(request, pages(num_events, read_columns), declared, remarks)
    sensor = stated_sensor(request, declared, remarks)
    only_stamps = read_stamps or (lambda start, stop: read_columns(start, stop).t)
    if sensor is None:
        probes = [(start, read_columns(start, stop)) for start, stop in _places(num_events, _MANY_PROBES)]
        sensor = _probed_sensor([probe for _, probe in probes], request, num_events, read_columns, remarks)
        _check_probes([(start, probe.t) for start, probe in probes], request.name)
    else:
        places = _places(num_events, _FEW_PROBES)
        _check_probes([(start, only_stamps(start, stop)) for start, stop in places], request.name)
    coded = read_columns(0, min(num_events, _PROBE)).p
    if coded.dtype.kind in "biuf" and coded.min() >= -1 and coded.max() <= 1:  # any other coding is refused on reading
        say_coding(float(coded.min()), coded.dtype.kind == "b", remarks)
    span = Span(int(only_stamps(0, 1)[0]), int(only_stamps(num_events - 1, num_events)[0]))
    lock = Lock()
    stamps = None
    if num_events >= LONG:
        stamps = StampIndex(request, num_events, only_stamps, lock)
        request.resources.callback(stamps.stop)
    source = PagedSource(request, what, num_events, sensor, read_columns, lock, stamps)
    return Collected(source, sensor, span)


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


def _check_probes(probes: list[tuple[int, np.ndarray]], name: str) -> None:
    """Within each probe and from one to the next, so that the last event is not before the first."""
    before = None
    for start, t in probes:
        _check_order(t, start, name)
        if before is not None and start >= before[0] and t[0] < before[1]:
            raise RecordingError(
                f"{name}: time runs back before event {start} ({before[1]} > {t[0]} µs); open it with --sort"
            )
        before = (start + len(t), int(t[-1]))


def _probed_sensor(
    pieces: list[Decoded],
    request: Request,
    num_events: int,
    read_columns: ReadColumns,
    remarks: Remarks,
) -> Sensor:
    """From all events of a short file, from the probes of a long one (which then must fill a known sensor)."""
    where = "the events looked at"
    if num_events <= 16 * PAGE:
        pieces, where = list(pages(num_events, read_columns)), "the events"
    reach_x = max(int(pixel_column(piece.x, "x", request.name).max(initial=0)) for piece in pieces)
    reach_y = max(int(pixel_column(piece.y, "y", request.name).max(initial=0)) for piece in pieces)
    return deduced_sensor(reach_x, reach_y, request.name, remarks, where)


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
