"""The HDF5 layouts of event vision: those that are known by name, then columns wherever they are. Read by slice.

event_utils: TimoStoff/event_utils, lib/data_formats/event_packagers.py. DSEC: dsec.ifi.uzh.ch/data-format.
MVSEC: daniilidis-group.github.io/mvsec/download.
"""

from __future__ import annotations

from dataclasses import replace

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.column_finder import Columns, Found, Tree, find_events
from etnet.events.formats.column_names import stated_unit
from etnet.events.formats.column_views import Field, Rows
from etnet.events.formats.declared_size import sensor_resolution, size_beside, unless_stated
from etnet.events.formats.frames import Frames, found_frames
from etnet.events.formats.hdf5.file import columns, dataset, find, open_file, say_unread
from etnet.events.formats.hdf5.frames import numbered_frames, stack_without_stamps, stacked_frames, stacked_pair
from etnet.events.formats.hdf5.metavision import open_metavision
from etnet.events.formats.hdf5.tree import attributes_of, check_columns, outline, tree_of
from etnet.events.formats.hdf5.triggers import triggers_beside
from etnet.events.formats.open_columns import Table, open_table
from etnet.events.formats.unchanged import Unchanged
from etnet.events.provenance import ATTRIBUTES, provenance_of

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DAVIS346 = Sensor(346, 260)
_EVENT_UTILS = (
    ("events/xs", "events/ys", "events/ts", "events/ps"),
    ("events/x", "events/y", "events/ts", "events/p"),
)


def is_hdf5(request: Request) -> bool:
    """By signature, at the start or after a user block of 512 … 2048 bytes."""
    return any(request.head[place : place + 8] == SIGNATURE for place in (0, 512, 1024, 2048))


def holds_events(request: Request) -> bool:
    """Whether a layout of events is in it; of a folder's files, some hold calibrations and labels alone."""
    file = open_file(request)
    if any(_has(file, path, request) for path in ("davis/left/events", "davis/right/events", "CD/events")):
        return True
    return find_events(tree_of(file, request.name), Remarks()) is not None


def _has(file: h5py.File, path: str, request: Request) -> bool:
    return find(file, path, request.name) is not None


def _open(request: Request) -> Opened:
    file = open_file(request)
    return Unchanged(request).guarding(_open_file(request, file))


def _open_file(request: Request, file: h5py.File) -> Opened:
    with contained(request.name, "HDF5"):
        if _has(file, "CD/events", request) and not _is_mvsec(request, file):
            return open_metavision(request, file)
        opened = _open_columns(request, file)
        remarks = Remarks(list(opened.remarks))
        triggers = triggers_beside(file, request.name, remarks)
        # No other attribute is read for it: what cannot be read must not cost the recording.
        made = provenance_of({name: file.attrs[name] for name in ATTRIBUTES if name in file.attrs})
        return replace(opened, remarks=tuple(remarks.kept), triggers=triggers, provenance=made)


def _is_mvsec(request: Request, file: h5py.File) -> bool:
    return any(_has(file, f"davis/{side}/events", request) for side in ("left", "right"))


def _open_columns(request: Request, file: h5py.File) -> Opened:
    if _is_mvsec(request, file):
        return _open_mvsec(request, file)
    for paths in _EVENT_UTILS:
        if all(_has(file, path, request) for path in paths):
            return _open_event_utils(request, file, paths)
    return _open_found(request, file)


def _open_event_utils(request: Request, file: h5py.File, paths: tuple[str, str, str, str]) -> Opened:
    remarks = Remarks()
    x, y, t, p = columns(file, paths, request.name)
    check_columns(file, set(paths), request.name)
    stated_count = file.attrs.get("num_events")
    if stated_count is not None and np.size(stated_count) == 1 and int(stated_count) != len(t):
        remarks.detected(f"the file's attribute says {int(stated_count)} events, its columns hold {len(t)}")
    tree = tree_of(file, request.name)
    table = Table(
        "event_utils HDF5",
        {"x": x, "y": y, "t": t, "p": p},
        size_in(request, file, tree, "events"),
        settled=stated_unit(file.attrs.get("time_unit")),
        usual="s" if t.dtype.kind == "f" else None,
        frames=frames_in(request, file, tree, remarks),
    )
    return open_table(request, table, remarks)


def _open_found(request: Request, file: h5py.File) -> Opened:
    """DSEC, and every other file whose columns, records or table of events can be found."""
    remarks, tree = Remarks(), tree_of(file, request.name)
    found = find_events(tree, remarks)
    if found is None:
        raise RecordingError(
            f"{request.name}: an HDF5 file with {outline(file)}; wanted columns called x, y, t and p in one group, "
            "records with these fields, or a table of four columns called events"
        )
    if found.order:
        remarks.assumed(f"the four columns of {found.where} are {', '.join(found.order)}, judged by their values")
    check_columns(file, set(found.paths), request.name)
    is_dsec = _has(file, "ms_to_idx", request)
    offset = offset_in(file, request) if _has(file, "t_offset", request) else 0
    kind = "DSEC HDF5" if is_dsec else _kind(found, file, request)
    if kind == "DSEC HDF5":
        remarks.kept = [remark for remark in remarks.kept if remark.text != "events are in events"]
    table = Table(
        kind,
        found.columns,
        size_in(request, file, tree, found.where),
        settled="us" if is_dsec else found.unit,
        offset=offset,
        frames=frames_in(request, file, tree, remarks),
    )
    return open_table(request, table, remarks)


def _kind(found: Found, file: h5py.File, request: Request) -> str:
    if _has(file, "prophesee/left", request) and _has(file, f"{found.where}/ms_map_idx", request):
        return "M3ED HDF5"
    return "HDF5 table" if found.order else "HDF5 columns"


def offset_in(file: h5py.File, request: Request) -> int:
    """DSEC's t_offset, µs."""
    stored = dataset(file, "t_offset", request.name, ndim=None)
    value = np.asarray(stored[()]).ravel() if stored.size == 1 else np.empty(0)
    if value.size != 1 or value.dtype.kind not in "iu" or abs(int(value[0])) >= 2**61:
        raise RecordingError(f"{request.name}: t_offset is {value[:3]}; wanted one whole number of µs")
    return int(value[0])


def size_in(request: Request, file: h5py.File, tree: Tree, where: str) -> Sensor | None:
    """The size of the sensor, where the file states it."""
    return unless_stated(request, lambda: _attribute(request, file) or _size_beside(request, file, tree, where))


def _attribute(request: Request, file: h5py.File) -> Sensor | None:
    return sensor_resolution(file.attrs.get("sensor_resolution"), request.name)


def _size_beside(request: Request, file: h5py.File, tree: Tree, where: str) -> Sensor | None:
    return size_beside(tree, where, lambda group: attributes_of(file, group, request.name), request.name)


def frames_in(request: Request, file: h5py.File, tree: Tree, remarks: Remarks) -> Frames | None:
    """The pictures, numbered or in one stack; what cannot be shown is said."""
    most, name = request.assume.max_pixels, request.name
    numbered = found_frames(lambda: numbered_frames(file, name, most, remarks), name, remarks)
    pair = stacked_pair(tree) if numbered is None else None
    if pair is None:
        left = stack_without_stamps(tree) if numbered is None else None
        if left is not None:
            shape = "×".join(map(str, tree[left].shape))
            remarks.detected(f"pictures in {left} ({shape}) have no stamps beside them, such as {left}_ts: not shown")
        return numbered
    remarks.detected(f"frames are in {pair[0]}, their stamps in {pair[1]}")
    return found_frames(lambda: stacked_frames(file, *pair, name, most), name, remarks)


def _open_mvsec(request: Request, file: h5py.File) -> Opened:
    remarks, name = Remarks(), request.name
    sides = [side for side in ("left", "right") if _has(file, f"davis/{side}/events", request)]
    where = f"davis/{sides[0]}"
    if len(sides) == 2:
        remarks.detected("two cameras; the left one is shown")
    table = dataset(file, f"{where}/events", name, ndim=2)
    if table.shape[1] != 4:
        raise RecordingError(f"{name}: {where}/events has {table.shape[1]} columns; wanted x, y, t, p")
    check_columns(file, {f"{where}/events"}, name)
    frames = None
    if _has(file, f"{where}/image_raw", request) and _has(file, f"{where}/image_raw_ts", request):
        most = request.assume.max_pixels
        pair = f"{where}/image_raw", f"{where}/image_raw_ts"
        frames = found_frames(lambda: stacked_frames(file, *pair, name, most), name, remarks)
    stated = unless_stated(request, lambda: _attribute(request, file))
    declared = stated or (frames.size if frames is not None else _DAVIS346)
    if frames is None and stated is None and request.assume.sensor is None:
        remarks.assumed("sensor 346×260, MVSEC's DAVIS346: the file has no pictures that would tell")
    say_unread(file, f"{where}/imu", "samples of motion", name, remarks)
    rows = Rows(table, 4)
    found: Columns = {axis: Field(rows, i) for i, axis in enumerate("xytp")}
    return open_table(request, Table("MVSEC HDF5", found, declared, fixed="s", frames=frames), remarks)


HDF5 = Format("HDF5", (".h5", ".hdf5", ".hdf"), is_hdf5, _open, holds_events=holds_events)
