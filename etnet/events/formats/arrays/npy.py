"""numpy files: npz with named columns, npy tables and structured arrays (tonic), and EVREAL's folder of npy files.

EVREAL: ercanburak/EVREAL, tools/bag_to_npy.py (events_ts in s, events_xy, events_p, images, images_ts, metadata.json).
"""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.cache import grey
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore, Store, ZipStore, read_small
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.camera_frames import check_size, in_order
from etnet.events.formats.column_names import column_keys
from etnet.events.formats.columns import guessed_unit, stamps_in_microseconds
from etnet.events.formats.decode import Decoded
from etnet.events.formats.paged import paged
from etnet.events.recording import GroundTruth


@runtime_checkable
class Column(Protocol):
    """Numbers in memory or in a file, read by slice."""

    def __len__(self) -> int:
        """How many there are."""
        ...

    def __getitem__(self, part: slice, /) -> Any:
        """Some of them, as an array."""
        ...


Columns = dict[str, Column]
"""x, y, t and p."""


def columns_of_array(array: np.ndarray, name: str, remarks: Remarks) -> Columns:
    """A structured array with named fields, or a table of four columns whose order is deduced from their values."""
    if array.dtype.names is not None:
        keys = column_keys(array.dtype.names)
        if keys is None:
            raise RecordingError(
                f"{name}: a structured array with {array.dtype.names}; wanted the fields x, y, t and p"
            )
        return {axis: array[key].reshape(-1) for axis, key in keys.items()}
    if array.ndim == 2 and array.shape[1] != 4 and array.shape[0] == 4:
        array = array.T
    if array.ndim != 2 or array.shape[1] != 4 or array.dtype.kind not in "iuf":
        raise RecordingError(f"{name}: an array of {array.dtype} and shape {array.shape}; wanted n × 4 numbers")
    order = _table_order(array)
    remarks.assumed(f"the four columns are {', '.join(order)}, judged by their values")
    return {axis: array[:, order.index(axis)] for axis in "xytp"}


def _table_order(table: np.ndarray) -> tuple[str, str, str, str]:
    """p is the last column, t the first or the third: the one with fractions, else the ordered one, else the larger."""
    sample = np.asarray(table[:: max(1, len(table) // 10_000)], np.float64)
    signs = (
        lambda column: bool((column != np.floor(column)).any()),
        lambda column: bool((np.diff(column) >= 0).all()),
    )
    for is_time in signs:
        first, third = is_time(sample[:, 0]), is_time(sample[:, 2])
        if first != third:
            return ("t", "x", "y", "p") if first else ("x", "y", "t", "p")
    is_larger = len(sample) > 0 and sample[:, 0].max() > sample[:, 2].max()
    return ("t", "x", "y", "p") if is_larger else ("x", "y", "t", "p")


def open_columns(
    request: Request,
    kind: str,
    found: Columns,
    declared: Sensor | None,
    remarks: Remarks,
    truth: GroundTruth | None = None,
    is_seconds: bool = False,
) -> Opened:
    """Columns in memory or mapped become a paged recording."""
    lengths = {axis: len(column) for axis, column in found.items()}
    if len(set(lengths.values())) != 1:
        raise RecordingError(f"{request.name}: its columns differ in length ({lengths}); the file is damaged")
    x, y, t, p = (found[axis] for axis in "xytp")
    if is_seconds and request.assume.time_unit is None:
        unit = "s"
    else:
        unit = guessed_unit(np.concatenate([t[:4096], t[-1:]]), request.assume, remarks)

    def read(start: int, stop: int) -> Decoded:
        stamps = stamps_in_microseconds(np.asarray(t[start:stop]), unit, request.name)
        return Decoded(np.asarray(x[start:stop]), np.asarray(y[start:stop]), stamps, np.asarray(p[start:stop]))

    collected = paged(request, kind, len(t), read, declared, remarks)
    return Opened(kind, collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth)


def _open_npy(request: Request) -> Opened:
    remarks = Remarks()
    with contained(request.name, "the npy array"):
        array = np.load(request.path, mmap_mode="r", allow_pickle=False)
        found = columns_of_array(array, request.name, remarks)
    return open_columns(request, "npy array", found, None, remarks)


def _open_npz(request: Request) -> Opened:
    """Only what is used is unpacked, into scratch, and stays there."""
    remarks = Remarks()
    store = ZipStore(request.path, request.resources)
    names = [member.removesuffix(".npy") for member in request.members]
    keys = column_keys(names)
    with contained(request.name, "the npz archive"):
        if keys is not None:
            found: Columns = {axis: _mapped(store, f"{key}.npy", request).reshape(-1) for axis, key in keys.items()}
        elif "events" in names:
            found = columns_of_array(_mapped(store, "events.npy", request), request.name, remarks)
        else:
            raise RecordingError(f"{request.name}: an npz with {', '.join(names[:8])}; wanted x, y, t and p, or events")
        declared = _npz_sensor(store, names, request.name)
    return open_columns(request, "npz columns", found, declared, remarks)


def _npz_sensor(store: Store, names: list[str], label: str) -> Sensor | None:
    if "width" not in names or "height" not in names:
        return None
    sides = [
        np.load(io.BytesIO(read_small(store, f"{name}.npy", label)), allow_pickle=False) for name in ("width", "height")
    ]
    return Sensor(int(sides[0]), int(sides[1]))


def _evreal_prefix(names: tuple[str, ...]) -> str | None:
    for name in names:
        if name.rsplit("/", 1)[-1] == "events_ts.npy":
            return name[: -len("events_ts.npy")]
    return None


def _open_evreal(request: Request) -> Opened:
    remarks = Remarks()
    store: Store = FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, request.resources)
    prefix = _evreal_prefix(request.members) or ""
    with contained(request.name, "the EVREAL arrays"):
        t, p, xy = (_mapped(store, f"{prefix}events_{part}.npy", request) for part in ("ts", "p", "xy"))
        if xy.ndim != 2 or xy.shape[1] != 2:
            raise RecordingError(f"{request.name}: events_xy.npy has the shape {xy.shape}; wanted n × 2")
        found = {"x": xy[:, 0], "y": xy[:, 1], "t": t.reshape(-1), "p": p.reshape(-1)}
        truth = _evreal_frames(store, prefix, request, remarks)
        declared = _evreal_sensor(store, prefix, request.name, truth)
    return open_columns(request, "EVREAL npy folder", found, declared, remarks, truth, is_seconds=True)


def _mapped(store: Store, member: str, request: Request) -> np.ndarray:
    """An npy file as a memory map; one in an archive is unpacked to scratch first."""
    if member not in request.members:
        raise RecordingError(f"{request.name}: {member} is missing; an EVREAL folder needs it")
    path: Path | None = store.local_path(member)
    if path is None:
        path = request.scratch.path(member.replace("/", "_"), store.size(member))
        with store.open(member) as packed, path.open("wb") as plain:
            shutil.copyfileobj(packed, plain, 1 << 20)
    return np.load(path, mmap_mode="r", allow_pickle=False)


def _evreal_frames(store: Store, prefix: str, request: Request, remarks: Remarks) -> GroundTruth | None:
    if prefix + "images.npy" not in request.members or prefix + "images_ts.npy" not in request.members:
        return None
    pictures = _mapped(store, prefix + "images.npy", request)
    seconds = np.asarray(_mapped(store, prefix + "images_ts.npy", request)).reshape(-1)
    if pictures.ndim not in (3, 4) or len(pictures) != len(seconds) or pictures.dtype.kind not in "uf":
        raise RecordingError(
            f"{request.name}: images.npy is {pictures.dtype} {pictures.shape} for {len(seconds)} stamps"
        )
    if len(seconds) == 0:
        return None
    check_size(pictures.shape[1:], f"{request.name}: images.npy")

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        return grey(np.asarray(pictures[index]))

    stamps = stamps_in_microseconds(seconds, request.assume.time_unit or "s", request.name)
    return in_order(stamps, GroundTruth(stamps, read_frame), remarks)


def _evreal_sensor(store: Store, prefix: str, name: str, truth: GroundTruth | None) -> Sensor | None:
    if prefix + "metadata.json" in store.names():
        size = json.loads(read_small(store, prefix + "metadata.json", name)).get("sensor_resolution")
        if isinstance(size, list) and len(size) >= 2:
            return Sensor(int(size[1]), int(size[0]))
    if truth is None:
        return None
    height, width = truth.read_frame(0).shape
    return Sensor(width, height)


def _is_npz(request: Request) -> bool:
    is_zip = request.head[:4] == b"PK\x03\x04"
    return is_zip and bool(request.members) and all("/" not in m and m.endswith(".npy") for m in request.members)


NPY = Format("npy", (".npy",), lambda request: request.head[:6] == b"\x93NUMPY", _open_npy)
EVREAL = Format("EVREAL npy", (".zip", ""), lambda request: _evreal_prefix(request.members) is not None, _open_evreal)
NPZ = Format("npz", (".npz",), _is_npz, _open_npz)
