"""MATLAB files, v5 (scipy) and v7.3 (HDF5): x, y, ts, p as vectors or in a struct such as TD; pixels count from 1."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.archive import FREE_SIZE, MAX_RATIO
from etnet.events.formats.arrays import matlab_child
from etnet.events.formats.arrays.npy import Column, Columns, open_columns
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.column_names import column_keys
from etnet.events.formats.hdf5.file import check_growth, dataset, open_file
from etnet.events.formats.paged import PAGE

LARGEST_V5 = 4 << 30
"""Bytes of a v5 file: the format itself ends there."""

LONGEST_V5 = 120
"""Seconds that reading one may take."""


def _open_v5(request: Request) -> Opened:
    if request.path.stat().st_size > LARGEST_V5:
        raise RecordingError(f"{request.name}: larger than a v5 MATLAB file can be; it is damaged")
    folder = request.scratch.path("x.npy", request.path.stat().st_size).parent
    told = _copy_columns(request, folder)
    if told["where"] is None:
        raise _without_columns(request, told["variables"])
    with contained(request.name, "the MATLAB file"):
        found = {axis: np.load(folder / f"{axis}.npy", mmap_mode="r", allow_pickle=False) for axis in "xytp"}
    return _open_found(request, "MATLAB v5", found, told["where"])


def _copy_columns(request: Request, folder: Path) -> dict[str, Any]:
    """Let a process of its own read the file: on some damaged files scipy's reader crashes the interpreter."""
    unpacked = max(FREE_SIZE, MAX_RATIO * request.path.stat().st_size)
    command = [
        sys.executable,
        "-P",
        "-m",
        matlab_child.__name__,
        str(request.path.resolve()),
        str(folder),
        str(unpacked),
    ]
    search = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_V5, env=search)
    except subprocess.TimeoutExpired:
        raise RecordingError(
            f"{request.name}: reading took more than {LONGEST_V5} s; the file may be damaged"
        ) from None
    if child.returncode != 0:
        lines = child.stderr.strip().splitlines()
        reason = lines[-1][:200] if lines and child.returncode == 1 else "it ended the reader"
        raise RecordingError(f"{request.name}: cannot read the MATLAB file ({reason}); it may be truncated or damaged")
    return json.loads(child.stdout)


def _without_columns(request: Request, variables: Iterable[str]) -> RecordingError:
    return RecordingError(
        f"{request.name}: variables {', '.join(list(variables)[:8]) or 'none'}; wanted x, y, ts and p"
    )


def _open_v73(request: Request) -> Opened:
    file = open_file(request)
    with contained(request.name, "the MATLAB file"):
        groups = {"": file, **{key: file[key] for key in _own_members(file, h5py.Group) if not key.startswith("#")}}
        for where, group in groups.items():
            keys = column_keys(name for name in _own_members(group, h5py.Dataset) if group[name].dtype.kind in "iufb")
            if keys is not None:
                found: Columns = {}
                for axis, key in keys.items():
                    found[axis] = _Vector(dataset(group, key, request.name, ndim=None), key, request.name)
                return _open_found(request, "MATLAB v7.3", found, where)
        raise _without_columns(request, file.keys())


def _own_members(group: h5py.Group, kind: type) -> list[str]:
    """Names of what lies in the group itself; no link is followed."""
    own = [key for key in group.keys() if isinstance(group.get(key, getlink=True), h5py.HardLink)]  # noqa: SIM118
    return [key for key in own if isinstance(group[key], kind)]


class _Vector:
    """A vector as MATLAB v7.3 stores it, all sides but one of length 1; it is read by slice."""

    def __init__(self, stored: h5py.Dataset, key: str, name: str) -> None:
        if not stored.shape or stored.size != max(stored.shape):
            raise RecordingError(f"{name}: {key} has the shape {stored.shape}; wanted a vector")
        check_growth(stored, key, name)
        self._stored = stored
        self._side = stored.shape.index(max(stored.shape))

    def __len__(self) -> int:
        return self._stored.shape[self._side]

    def __getitem__(self, part: slice) -> np.ndarray:
        start, stop, _ = part.indices(len(self))
        places: list[int | slice] = [0] * self._stored.ndim
        places[self._side] = slice(start, stop)
        return np.asarray(self._stored[tuple(places)])


@dataclass(frozen=True)
class _Less:
    """A column whose numbers are all smaller by one than they are stored."""

    stored: Column

    def __len__(self) -> int:
        return len(self.stored)

    def __getitem__(self, part: slice) -> np.ndarray:
        return np.asarray(self.stored[part]) - 1


def _open_found(request: Request, kind: str, found: Columns, where: str) -> Opened:
    remarks = Remarks()
    if where:
        remarks.detected(f"events in the struct {where}")
    with contained(request.name, "its columns"):
        if _counts_from_one(found["x"]) and _counts_from_one(found["y"]):
            found = {axis: _Less(column) if axis in "xy" else column for axis, column in found.items()}
            remarks.assumed("pixels count from 1, as MATLAB does (none is 0), and were moved by one")
        if _is_one_and_two(found["p"]):
            found["p"] = _Less(found["p"])
            remarks.repaired("polarity 1/2 was read as OFF/ON")
    return open_columns(request, kind, found, None, remarks)


def _counts_from_one(column: Column) -> bool:
    return all(bool((part >= 1).all()) for part in _parts(column))


def _is_one_and_two(column: Column) -> bool:
    has_two = False
    for part in _parts(column):
        is_two = part == 2
        if not (is_two | (part == 1)).all():
            return False
        has_two = has_two or bool(is_two.any())
    return has_two


def _parts(column: Column) -> Iterator[np.ndarray]:
    for start in range(0, len(column), PAGE):
        yield np.asarray(column[start : start + PAGE])


MATLAB_V5 = Format("MATLAB v5", (".mat",), lambda request: request.head[:19] == b"MATLAB 5.0 MAT-file", _open_v5)
MATLAB_V73 = Format("MATLAB v7.3", (".mat",), lambda request: request.head[:10] == b"MATLAB 7.3", _open_v73)
