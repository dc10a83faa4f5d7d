"""A recording in numbered pieces, one npz or npy each: simulators write one for each frame, BS-ERGB and HS-ERGB too.

BS-ERGB: uzh-rpg/timelens-pp (x and y as 32nds of a pixel); HS-ERGB: uzh-rpg/rpg_timelens. Their pictures lie in a
folder beside that of the events, with one stamp a line.
"""

from __future__ import annotations

import re
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from io import BufferedWriter
from pathlib import Path

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore, Store, ZipStore
from etnet.events.formats.arrays.leaves import held, leaves_of, load_foreign
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import Unpacked
from etnet.events.formats.column_finder import Column, Columns, Found, Leaf, find_events
from etnet.events.formats.columns import LARGEST_STAMP
from etnet.events.formats.frames import found_frames
from etnet.events.formats.open_columns import Table, open_table, places_of
from etnet.events.formats.picture_lists import pictures_beside
from etnet.events.formats.pixels import Reach, in_pixels, placed
from etnet.events.formats.wrapping_clock import WrappingClock

MOST_CHUNKS = 100_000
_STEP = 1 << 20

_NUMBERED = re.compile(r"^(.*?)(\d+)\.(npz|npy)$", re.IGNORECASE)


def chunks_of(members: tuple[str, ...]) -> tuple[str, list[str]] | None:
    """The folder ("" or "events/") whose numbered npz or npy files are one recording, and they in their order."""
    groups: dict[tuple[str, str, str], list[tuple[int, str]]] = {}
    for member in members:
        folder, slash, last = member.rpartition("/")
        numbered = _NUMBERED.match(last)
        if numbered is not None:
            key = folder + slash, numbered[1].lower(), numbered[3].lower()
            groups.setdefault(key, []).append((int(numbered[2]), member))
    several = {key: sorted(found) for key, found in groups.items() if len(found) > 1}
    named = {key: found for key, found in several.items() if "event" in "".join(key[:2]).lower()} or several
    if len(named) != 1:
        return None
    ((folder, _, _), found), *_ = named.items()
    return folder, [member for _, member in found]


def _is_chunked(request: Request) -> bool:
    if not request.path.is_dir() and request.suffix != ".zip":
        return False
    found = chunks_of(request.members)
    if found is None:
        return False
    with ExitStack() as briefly, suppress(RecordingError):
        inner = replace(request, resources=briefly)
        return _part(inner, _store(inner), found[1][0]) is not None
    return False


def _store(request: Request) -> Store:
    return FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, request.resources)


def _local(request: Request, store: Store, member: str) -> Path:
    """The piece as a file; one in an archive takes the place of the one before it in scratch."""
    path = store.local_path(member)
    if path is None:
        path = request.scratch.path("piece" + member[-4:].lower(), store.size(member))
        unpacked = Unpacked(max(1, request.path.stat().st_size), request.name)
        with store.open(member) as packed, path.open("wb") as plain:
            while block := packed.read(_STEP):
                unpacked.take(len(block))
                plain.write(block)
    return path


def _part(request: Request, store: Store, member: str) -> Found | None:
    """The events of one piece, in memory or mapped while its file is open."""
    label = f"{request.name}: {member}"
    with contained(request.name, member):
        path = _local(request, store, member)
        if member.lower().endswith(".npy"):
            array = load_foreign(path, label, request)
            return find_events({"events": Leaf(array.shape, array.dtype, lambda: array)}, Remarks())
        inner = ZipStore(path, request.resources)
        return find_events(leaves_of(inner, inner.names(), replace(request, name=label), held), Remarks())


def _open(request: Request) -> Opened:
    remarks = Remarks()
    folder, members = chunks_of(request.members) or ("", [])
    if len(members) > MOST_CHUNKS:
        raise RecordingError(f"{request.name}: {len(members):,} pieces; at most {MOST_CHUNKS:,} are joined")
    store, most = _store(request), request.assume.max_pixels
    found = _gathered(request, store, members)
    remarks.detected(f"{len(members)} numbered files in {folder or 'the folder'} are one recording, in their order")
    root = folder.rstrip("/").rpartition("/")[0]
    prefix = root + "/" if root else ""
    frames = found_frames(lambda: pictures_beside(store, prefix, request.name, remarks, most), request.name, remarks)
    columns, kind = found.columns, "npz pieces" if members[0].lower().endswith("npz") else "npy pieces"
    if frames is not None and request.assume.pixels == "whole" and _is_fixed_point(columns, frames.size, request.name):
        columns = {axis: _Pixels(column) if axis in "xy" else column for axis, column in columns.items()}
        remarks.repaired("x and y are 32nds of a pixel, as in BS-ERGB: they reach 32 times the pictures; divided by 32")
        kind = "BS-ERGB folder"
    table = Table(kind, columns, settled=found.unit)
    return open_table(request, replace(table, frames=frames), remarks)


def _gathered(request: Request, store: Store, members: list[str]) -> Found:
    """All pieces behind one another in one scratch file for each column."""
    files: dict[str, tuple[Path, np.dtype]] = {}
    first: Found | None = None
    last: float | None = None
    with ExitStack() as open_files:
        written: dict[str, BufferedWriter] = {}
        for number, member in enumerate(members):
            request.progress(0.5 * number / len(members))
            with ExitStack() as briefly:
                found = _part(replace(request, resources=briefly), store, member)
                if found is None or (first is not None and found.order != first.order):
                    raise RecordingError(f"{request.name}: {member} has other columns than {members[0]}; move it away")
                last = _check_begins_after(found, last, member, request)
                for axis, column in found.columns.items():
                    numbers = np.ascontiguousarray(column[: len(column)])
                    if axis not in files:
                        files[axis] = request.scratch.path(f"{axis}.joined"), numbers.dtype
                        written[axis] = open_files.enter_context(files[axis][0].open("wb"))
                    request.scratch.path("", numbers.nbytes)
                    written[axis].write(numbers.astype(files[axis][1]).tobytes())
            first = first or found
    if first is None or any(path.stat().st_size == 0 for path, _ in files.values()):
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    columns: Columns = {axis: np.memmap(path, dtype, "r") for axis, (path, dtype) in files.items()}
    return replace(first, columns=columns)


def _check_begins_after(found: Found, last: float | None, member: str, request: Request) -> float | None:
    """The last stamp of a piece; an error where it begins far before the one before it ends."""
    t = found.columns["t"]
    if len(t) == 0:
        return last
    begin, end = float(np.asarray(t[:1])[0]), float(np.asarray(t[len(t) - 1 :])[0])
    if last is not None and last - begin > 0.5 * abs(end - begin) and not _wraps(last, begin):
        raise RecordingError(
            f"{request.name}: numbered files, of which {member} begins before the one before it ends: each is a "
            "recording of its own; name one of them"
        )
    return end


def _wraps(last: float, begin: float) -> bool:
    """Whether a clock wrapped between these stamps, of which the first is a piece's last."""
    if max(abs(last), abs(begin)) >= LARGEST_STAMP:
        return False
    clock = WrappingClock()
    clock.unrolled(np.array([last, begin]).astype(np.int64))
    return clock.turns > 0


def _is_fixed_point(columns: Columns, size: Sensor, name: str) -> bool:
    """Whether coordinates are 32nds of the pixels of pictures of this size."""
    reach = Reach()
    for part in places_of(len(columns["t"])):
        there = placed(np.asarray(columns["x"][part]), np.asarray(columns["y"][part]), "whole", name)
        reach.look(there.x, there.y)
    return reach.is_fixed_point and max(reach.high_x, reach.high_y) >= 2 * max(size.width, size.height)


@dataclass(frozen=True)
class _Pixels:
    """A column of 32nds as pixels; below 0 is −1, which lies nowhere."""

    stored: Column

    def __len__(self) -> int:
        return len(self.stored)

    def __getitem__(self, part: slice) -> np.ndarray:
        return in_pixels(np.asarray(self.stored[part]), "32nds")


CHUNKS = Format("folder or zip of npz or npy pieces", ("", ".zip"), _is_chunked, _open)
