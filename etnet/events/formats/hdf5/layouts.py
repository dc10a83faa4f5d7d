"""The HDF5 layouts of event vision: event_utils (HQF, ET-Net, E2VID+), DSEC and MVSEC. Events are read in slices.

event_utils: TimoStoff/event_utils, lib/data_formats/event_packagers.py. DSEC: dsec.ifi.uzh.ch/data-format.
MVSEC: daniilidis-group.github.io/mvsec/download.
"""

from __future__ import annotations

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.clock32 import begins_anew, collect_unrolled
from etnet.events.formats.columns import guessed_unit, stamps_in_microseconds
from etnet.events.formats.decode import Decoded
from etnet.events.formats.hdf5.file import columns, dataset, find, open_file, say_unread
from etnet.events.formats.hdf5.frames import numbered_frames, stacked_frames
from etnet.events.formats.hdf5.metavision import open_metavision
from etnet.events.formats.paged import paged

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DAVIS346 = Sensor(346, 260)
_SAMPLES = 16


def is_hdf5(request: Request) -> bool:
    """By signature, at the start or after a user block of 512 … 2048 bytes."""
    return any(request.head[place : place + 8] == SIGNATURE for place in (0, 512, 1024, 2048))


def _open_event_utils(request: Request, file, paths: tuple[str, str, str, str]) -> Opened:
    remarks = Remarks()
    if isinstance(made := file.attrs.get("simulation"), str):
        remarks.detected(f"{str(file.attrs.get('source', 'simulated'))[:200]}, with {made[:1000]}")
    x, y, t, p = columns(file, paths, request.name)
    if len(t) == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    is_seconds = t.dtype.kind == "f" and request.assume.time_unit is None
    unit = "s" if is_seconds else guessed_unit(t[: min(len(t), 4096)], request.assume, remarks)

    def stamps(start: int, stop: int) -> np.ndarray:
        return stamps_in_microseconds(t[start:stop], unit, request.name)

    def read(start: int, stop: int) -> Decoded:
        return Decoded(x[start:stop], y[start:stop], stamps(start, stop), p[start:stop])

    truth = numbered_frames(file, request.name, unit, remarks)
    declared = _declared_size(file, request.name)
    if declared is None and truth is not None:
        height, width = truth.read_frame(0).shape
        declared = Sensor(width, height)
        remarks.detected(f"sensor {declared}, the size of the frames")
    stated_count = file.attrs.get("num_events")
    if stated_count is not None and np.size(stated_count) == 1 and int(stated_count) != len(t):
        remarks.detected(f"the file's attribute says {int(stated_count)} events, its columns hold {len(t)}")
    collected = paged(request, "event_utils HDF5", len(t), read, declared, remarks, stamps)
    return Opened("event_utils HDF5", collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)


def _declared_size(file, name: str) -> Sensor | None:
    size = file.attrs.get("sensor_resolution")
    if size is None:
        return None
    sides = np.asarray(size).ravel()
    if (
        sides.size < 2
        or sides.dtype.kind not in "iuf"
        or not bool((sides[:2] >= 1).all() and (sides[:2] <= 65_536).all())
    ):
        raise RecordingError(f"{name}: its attribute sensor_resolution is {size}; wanted (height, width)")
    return Sensor(int(sides[1]), int(sides[0]))


def _open_dsec(request: Request, file) -> Opened:
    remarks = Remarks()
    x, y, t, p = columns(file, ("events/x", "events/y", "events/t", "events/p"), request.name)
    is_dsec = find(file, "ms_to_idx", request.name) is not None
    offset = 0
    if find(file, "t_offset", request.name) is not None:
        value = np.asarray(dataset(file, "t_offset", request.name, ndim=None)[()]).ravel()
        if value.size != 1 or value.dtype.kind not in "iu" or abs(int(value[0])) >= 2**61:
            raise RecordingError(f"{request.name}: t_offset is {value[:3]}; wanted one whole number of µs")
        offset = int(value[0])
    unit = "us" if is_dsec and request.assume.time_unit is None else guessed_unit(t[:4096], request.assume, remarks)

    def stamps(start: int, stop: int) -> np.ndarray:
        return stamps_in_microseconds(t[start:stop], unit, request.name, offset)

    def read(start: int, stop: int) -> Decoded:
        return Decoded(x[start:stop], y[start:stop], stamps(start, stop), p[start:stop])

    kind = "DSEC HDF5" if is_dsec else "HDF5 columns"
    declared = _declared_size(file, request.name)
    if t.dtype == np.uint32 and unit == "us" and begins_anew(np.array([t[i] for i in _spread(len(t))])):
        collected = collect_unrolled(request, len(t), read, declared, remarks)
    else:
        collected = paged(request, kind, len(t), read, declared, remarks, stamps)
    return Opened(kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept))


def _spread(num_events: int) -> list[int]:
    """Some events from the first to the last; few, for each costs the reading of a chunk."""
    return sorted({int(place) for place in np.linspace(0, num_events - 1, _SAMPLES)}) if num_events else []


def _open_mvsec(request: Request, file) -> Opened:
    remarks = Remarks()
    sides = [side for side in ("left", "right") if find(file, f"davis/{side}/events", request.name) is not None]
    side = sides[0]
    if len(sides) == 2:
        remarks.detected("two cameras; the left one is shown")
    table = dataset(file, f"davis/{side}/events", request.name, ndim=2)
    if table.shape[1] != 4:
        raise RecordingError(f"{request.name}: davis/{side}/events has {table.shape[1]} columns; wanted x, y, t, p")

    def read(start: int, stop: int) -> Decoded:
        rows = np.asarray(table[start:stop], np.float64)
        return Decoded(rows[:, 0], rows[:, 1], stamps_in_microseconds(rows[:, 2], "s", request.name), rows[:, 3])

    truth = stacked_frames(file, f"davis/{side}/image_raw", request.name, remarks)
    declared = _DAVIS346
    if truth is not None:
        height, width = truth.read_frame(0).shape
        declared = Sensor(width, height)
    elif request.assume.sensor is None:
        remarks.assumed("sensor 346×260, MVSEC's DAVIS346: the file has no pictures that would tell")
    say_unread(file, f"davis/{side}/imu", "samples of motion", request.name, remarks)
    collected = paged(request, "MVSEC HDF5", len(table), read, declared, remarks)
    return Opened("MVSEC HDF5", collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)


def _open(request: Request) -> Opened:
    file = open_file(request)
    with contained(request.name, "HDF5"):
        has = lambda path: find(file, path, request.name) is not None  # noqa: E731
        if has("davis/left/events") or has("davis/right/events"):
            return _open_mvsec(request, file)
        if has("CD/events"):
            return open_metavision(request, file)
        if has("events/xs"):
            return _open_event_utils(request, file, ("events/xs", "events/ys", "events/ts", "events/ps"))
        if has("events/x") and has("events/ts"):
            return _open_event_utils(request, file, ("events/x", "events/y", "events/ts", "events/p"))
        if has("events/x") and has("events/t"):
            return _open_dsec(request, file)
        there = ", ".join(sorted(file.keys())[:8]) or "nothing"
    raise RecordingError(
        f"{request.name}: an HDF5 file with {there} at its top; wanted events/xs (event_utils), events/x and t (DSEC), "
        "davis/left/events (MVSEC) or CD/events (Metavision)"
    )


HDF5 = Format("HDF5", (".h5", ".hdf5", ".hdf"), is_hdf5, _open)
