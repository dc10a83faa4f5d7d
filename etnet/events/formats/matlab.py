"""MATLAB files, v5 (scipy) and v7.3 (HDF5): x, y, ts, p as vectors or in a struct such as TD; pixels count from 1."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats import matlab_child
from etnet.events.formats.arrays import Columns, named_columns, open_columns
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.hdf5 import dataset, open_file

LARGEST_V5 = 4 << 30
"""Bytes of a v5 file: the format itself ends there."""

LONGEST_V5 = 120
"""Seconds that reading one may take."""


def _open_v5(request: Request) -> Opened:
    if request.path.stat().st_size > LARGEST_V5:
        raise RecordingError(f"{request.name}: larger than a v5 MATLAB file can be; it is damaged")
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "numbers.npz"
        _copy_numbers(request, copied)
        with contained(request.name, "the MATLAB file"), np.load(copied, allow_pickle=False) as arrays:
            tree: dict[str, Any] = {}
            for name in arrays.files:
                struct, _, part = name.rpartition("/")
                (tree.setdefault(struct, {}) if struct else tree)[part] = arrays[name]
    return _open_tree(request, "MATLAB v5", tree)


def _copy_numbers(request: Request, target: Path) -> None:
    """Let a process of its own read the file: on some damaged files scipy's reader crashes the interpreter."""
    command = [sys.executable, "-m", matlab_child.__name__, str(request.path.resolve()), str(target)]
    search = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    try:
        child = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_V5, env=search)
    except subprocess.TimeoutExpired:
        raise RecordingError(
            f"{request.name}: reading took more than {LONGEST_V5} s; the file may be damaged"
        ) from None
    if child.returncode != 0 or not target.exists():
        lines = child.stderr.strip().splitlines()
        reason = lines[-1][:200] if lines and child.returncode == 1 else "it ended the reader"
        raise RecordingError(f"{request.name}: cannot read the MATLAB file ({reason}); it may be truncated or damaged")


def _open_v73(request: Request) -> Opened:
    file = open_file(request)
    with contained(request.name, "the MATLAB file"):
        tree: dict[str, Any] = {}
        for key in file.keys():  # noqa: SIM118  (iterating the file itself would follow links)
            node = file.get(key, getlink=True)
            if not isinstance(node, h5py.HardLink) or key.startswith("#"):
                continue
            group = file[key]
            if isinstance(group, h5py.Group):
                names = [name for name in group.keys() if isinstance(group.get(name, getlink=True), h5py.HardLink)]  # noqa: SIM118
                tree[key] = {name: _numbers(group, name, request) for name in names}
            else:
                tree[key] = _numbers(file, key, request)
    return _open_tree(request, "MATLAB v7.3", tree)


def _numbers(group: h5py.Group, name: str, request: Request) -> np.ndarray | None:
    if not isinstance(group[name], h5py.Dataset):
        return None
    column = dataset(group, name, request.name, ndim=None)
    return np.asarray(column[()]) if column.dtype.kind in "iufb" else None


def _open_tree(request: Request, kind: str, tree: dict[str, Any]) -> Opened:
    remarks = Remarks()
    found, where = _find(tree)
    if found is None:
        raise RecordingError(f"{request.name}: variables {', '.join(list(tree)[:8]) or 'none'}; wanted x, y, ts and p")
    if where:
        remarks.detected(f"events in the struct {where}")
    with contained(request.name, "its columns"):
        lowest = min(float(np.min(found[axis])) for axis in "xy") if len(found["x"]) else 1.0
        if lowest >= 1:
            found = {axis: column - 1 if axis in "xy" else column for axis, column in found.items()}
            remarks.assumed("pixels count from 1, as MATLAB does (none is 0), and were moved by one")
        if len(found["p"]) and set(np.unique(found["p"]).tolist()) == {1, 2}:
            found["p"] = found["p"] - 1
            remarks.repaired("polarity 1/2 was read as OFF/ON")
    return open_columns(request, kind, found, None, remarks)


def _find(tree: dict[str, Any]) -> tuple[Columns | None, str]:
    """Columns at the top, or in the first struct that has them all."""
    arrays = {key: value for key, value in tree.items() if isinstance(value, np.ndarray)}
    found = named_columns(arrays)
    if found is not None:
        return found, ""
    for key, value in tree.items():
        if isinstance(value, dict):
            found = named_columns({name: part for name, part in value.items() if isinstance(part, np.ndarray)})
            if found is not None:
                return found, key
    return None, ""


MATLAB_V5 = Format("MATLAB v5", (".mat",), lambda request: request.head[:19] == b"MATLAB 5.0 MAT-file", _open_v5)
MATLAB_V73 = Format("MATLAB v7.3", (".mat",), lambda request: request.head[:10] == b"MATLAB 7.3", _open_v73)
