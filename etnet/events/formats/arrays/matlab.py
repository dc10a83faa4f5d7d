"""MATLAB files, v5 (scipy) and v7.3 (HDF5): x, y, ts, p as vectors or in a struct such as TD; pixels count from 1."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.arrays import matlab_child
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import FREE_SIZE, MAX_RATIO, at_most
from etnet.events.formats.column_finder import Found, called, find_events
from etnet.events.formats.hdf5.file import open_file
from etnet.events.formats.hdf5.tree import check_columns, outline, tree_of
from etnet.events.formats.open_columns import Table, open_table
from etnet.events.formats.unchanged import Unchanged
from etnet.plain_values import PlainError, bounded_json

LARGEST_V5 = 4 << 30
"""Bytes of a v5 file: the format itself ends there."""

LONGEST_V5 = 120
"""Seconds that reading one may take."""

_LONGEST_ANSWER = 4 << 20
"""Characters that may be said of a file: the names of its variables above all."""


def _open_v5(request: Request) -> Opened:
    if request.path.stat().st_size > LARGEST_V5:
        raise RecordingError(f"{request.name}: larger than a v5 MATLAB file can be; it is damaged")
    folder = request.scratch.path("x.npy", request.path.stat().st_size).parent
    told = _copy_columns(request, folder)
    if told["where"] is None:
        raise _without_columns(request, ", ".join(told["variables"][:8]))
    remarks = Remarks()
    if told["where"]:
        remarks.detected(f"events in the {'matrix' if told['order'] else 'struct'} {told['where']}")
    for said in told["said"]:
        remarks.detected(said)
    _say_others(told["others"], remarks)
    with contained(request.name, "the MATLAB file"):
        columns = {axis: np.load(folder / f"{axis}.npy", mmap_mode="r", allow_pickle=False) for axis in "xytp"}
    return _open_found(request, "MATLAB v5", Found(told["where"], columns, told["unit"], told["order"]), remarks)


def _copy_columns(request: Request, folder: Path) -> dict[str, Any]:
    """Let a process of its own read the file: on some damaged files scipy's reader crashes the interpreter."""
    unpacked = max(at_most(FREE_SIZE), MAX_RATIO * request.path.stat().st_size)
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
    try:
        return bounded_json(child.stdout, _LONGEST_ANSWER)
    except PlainError as error:
        raise RecordingError(f"{request.name}: cannot read the MATLAB file (what is said of it {error})") from None


def _without_columns(request: Request, there: str) -> RecordingError:
    return RecordingError(
        f"{request.name}: variables {there or 'none'}; wanted x, y, ts and p, at the top or in a struct such as TD, or "
        "an n × 4 matrix called events"
    )


def _say_others(others: list[str], remarks: Remarks) -> None:
    """Structs that are no change events."""
    for name in others:
        remarks.detected(f"the struct {called(name)} was left out")


def _open_v73(request: Request) -> Opened:
    remarks = Remarks()
    file = open_file(request)
    unchanged = Unchanged(request)
    with contained(request.name, "the MATLAB file"):
        tree = tree_of(file, request.name)
        found = find_events(tree, remarks)
        if found is None:
            raise _without_columns(request, outline(file))
        check_columns(file, set(found.paths), request.name)
    return unchanged.guarding(_open_found(request, "MATLAB v7.3", found, remarks))


def _open_found(request: Request, kind: str, found: Found, remarks: Remarks) -> Opened:
    if found.order:
        remarks.assumed(f"its four columns are {', '.join(found.order)}, judged by their values")
    table = Table(kind, found.columns, settled=found.unit, may_count_from_one=True)
    return open_table(request, table, remarks)


MATLAB_V5 = Format("MATLAB v5", (".mat",), lambda request: request.head[:19] == b"MATLAB 5.0 MAT-file", _open_v5)
MATLAB_V73 = Format("MATLAB v7.3", (".mat",), lambda request: request.head[:10] == b"MATLAB 7.3", _open_v73)
