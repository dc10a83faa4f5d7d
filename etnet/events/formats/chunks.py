"""A recording in numbered pieces: npz or npy, of which simulators write one for each frame, HDF5 or text.

BS-ERGB: uzh-rpg/timelens-pp (x and y as 32nds of a pixel); HS-ERGB: uzh-rpg/rpg_timelens. Their pictures lie in a
folder beside that of the events, with one stamp a line.
"""

from __future__ import annotations

import re
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import Shaped

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.archive import FolderStore, Store, TooLarge, ZipStore
from etnet.events.formats.arrays.leaves import held, leaves_of, load_foreign
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import MAX_SMALL_FILE, Unpacked
from etnet.events.formats.column_finder import Column, Columns, Leaf, find_events
from etnet.events.formats.columns import LARGEST_STAMP
from etnet.events.formats.frames import Frames, found_frames
from etnet.events.formats.hdf5.piece import hdf5_piece
from etnet.events.formats.open_columns import Table, open_table, places_of
from etnet.events.formats.picture_lists import pictures_beside
from etnet.events.formats.piece import Piece
from etnet.events.formats.pixels import Reach, in_pixels, placed
from etnet.events.formats.text.piece import text_piece
from etnet.events.formats.wrapping_clock import WrappingClock

_NAMES = {"npz": "npz", "npy": "npy", "h5": "HDF5", "hdf5": "HDF5", "csv": "CSV", "txt": "text"}
MOST_CHUNKS = 100_000
_STEP = 1 << 20

_NUMBERED = re.compile(r"^(.*?)(\d+)\.(npz|npy|h5|hdf5|csv|txt)$", re.IGNORECASE)
_CAMERAS = re.compile(r"(cam|camera)_?$", re.IGNORECASE)
"""Before a number that counts cameras and no pieces."""


def chunks_of(members: tuple[str, ...]) -> tuple[str, list[str]] | None:
    """The folder ("" or "events/") whose numbered files may be one recording, and they in their order."""
    groups: dict[tuple[str, str, str], list[tuple[int, str]]] = {}
    for member in members:
        folder, slash, last = member.rpartition("/")
        numbered = _NUMBERED.match(last)
        if numbered is not None and not _CAMERAS.search(numbered[1]):
            key = folder + slash, numbered[1].lower(), numbered[3].lower()
            groups.setdefault(key, []).append((int(numbered[2]), member))
    several = {key: sorted(found) for key, found in groups.items() if len(found) > 1}
    named = {key: found for key, found in several.items() if "event" in "".join(key[:2]).lower()} or several
    if len(named) != 1:
        return None
    ((folder, _, _), found), *_ = named.items()
    return folder, [member for _, member in found]


def _is_chunked(request: Request) -> bool:
    """Whether numbered files are pieces. npz and npy are in any case: where they are not, opening them tells why."""
    return (request.path.is_dir() or request.suffix == ".zip") and are_pieces(request, trusts_names=True)


def are_pieces(request: Request, trusts_names: bool = False) -> bool:
    """Whether there are events in the first numbered file and later ones in the second, which may be a recording of
    its own. Where names are trusted, the first npz or npy suffices, and one that is too large to be looked into."""
    found = chunks_of(request.members)
    if found is None:
        return False
    last, offset = None, 0
    for number, member in enumerate(found[1][:2]):
        # One of an archive takes the place of the one before it, which must be closed by then.
        with ExitStack() as briefly:
            inner = replace(request, resources=briefly)
            try:
                store = _store(inner)
                if not trusts_names and _kind(member) not in ("h5", "hdf5") and store.size(member) > MAX_SMALL_FILE:
                    return False
                piece = _part(inner, store, member)
                if piece is None:
                    return False
                offset = piece.offset if number == 0 else offset
                last = _check_begins_after(piece, last, member, request, offset)
            except TooLarge:
                # By its name it is a piece all the same, and opening it tells the remedy.
                return trusts_names
            except RecordingError:
                return False
        if trusts_names and _kind(member) in ("npz", "npy"):
            return True
    return True


def _kind(member: str) -> str:
    return member.rpartition(".")[2].lower()


def _store(request: Request) -> Store:
    return FolderStore(request.path) if request.path.is_dir() else ZipStore(request.path, request.resources)


def _local(request: Request, store: Store, member: str) -> Path:
    """The piece as a file; one in an archive takes the place of the one before it in scratch."""
    path = store.local_path(member)
    if path is None:
        path = request.scratch.path(f"piece.{_kind(member)}", store.size(member))
        unpacked = Unpacked(max(1, request.path.stat().st_size), request.name)
        with store.open(member) as packed, path.open("wb") as plain:
            while block := packed.read(_STEP):
                unpacked.take(len(block))
                plain.write(block)
    return path


def _part(request: Request, store: Store, member: str) -> Piece | None:
    """The events of one piece, in memory or mapped while its file is open."""
    label = f"{request.name}: {member}"
    with contained(request.name, member):
        path = _local(request, store, member)
        if _kind(member) in ("h5", "hdf5"):
            return hdf5_piece(request, path, label)
        if _kind(member) in ("csv", "txt"):
            return text_piece(request, path, label)
        if _kind(member) == "npy":
            array = load_foreign(path, label, request)
            found = find_events({"events": Leaf(array.shape, array.dtype, lambda: array)}, Remarks())
        else:
            inner = ZipStore(path, request.resources)
            found = find_events(leaves_of(inner, inner.names(), replace(request, name=label), held), Remarks())
    return None if found is None else Piece(found)


def _open(request: Request) -> Opened:
    remarks = Remarks()
    folder, members = chunks_of(request.members) or ("", [])
    if len(members) > MOST_CHUNKS:
        raise RecordingError(f"{request.name}: {len(members):,} pieces; at most {MOST_CHUNKS:,} are joined")
    store, most = _store(request), request.assume.max_pixels
    gathered = _gathered(request, store, members)
    remarks.detected(f"{len(members)} numbered files in {folder or 'the folder'} are one recording, in their order")
    root = folder.rstrip("/").rpartition("/")[0]
    prefix = root + "/" if root else ""
    frames = gathered.pictures(remarks) or found_frames(
        lambda: pictures_beside(store, prefix, request.name, remarks, most), request.name, remarks
    )
    columns, kind = gathered.columns(), f"{_NAMES[_kind(members[0])]} pieces"
    if frames is not None and request.assume.pixels == "whole" and _is_fixed_point(columns, frames.size, request.name):
        columns = {axis: _Pixels(column) if axis in "xy" else column for axis, column in columns.items()}
        remarks.repaired("x and y are 32nds of a pixel, as in BS-ERGB: they reach 32 times the pictures; divided by 32")
        kind = "BS-ERGB folder"
    first = gathered.first
    table = Table(kind, columns, first.sensor, settled=first.found.unit, offset=first.offset, frames=frames)
    return open_table(request, table, remarks)


@dataclass
class _Joined:
    """One column behind the other in a scratch file, in a type that holds all of them."""

    path: Path
    dtype: np.dtype
    file: BinaryIO

    def add(self, numbers: Shaped[np.ndarray, " n"]) -> None:
        """Numbers of the next piece."""
        if not np.can_cast(numbers.dtype, self.dtype):
            self.file.flush()
            stored = np.fromfile(self.path, self.dtype)
            self.dtype = np.result_type(self.dtype, numbers.dtype)
            self.file.seek(0)
            self.file.write(stored.astype(self.dtype).tobytes())
        self.file.write(numbers.astype(self.dtype).tobytes())


@dataclass
class _Gathered:
    """All pieces of a recording. `first` is the first one, whose columns are not open any more."""

    request: Request
    store: Store
    first: Piece
    joined: dict[str, _Joined] = field(default_factory=dict)
    stamps: list[np.ndarray] = field(default_factory=list)
    places: list[tuple[str, int]] = field(default_factory=list)
    """Of each picture: which piece it is in, and which of that one's pictures it is."""

    def columns(self) -> Columns:
        """As they lie on the disk."""
        return {axis: np.memmap(one.path, one.dtype, "r") for axis, one in self.joined.items()}

    def add(self, piece: Piece, member: str, files: ExitStack) -> None:
        """The next piece, on the clock of the first."""
        for axis, column in piece.found.columns.items():
            numbers = np.ascontiguousarray(column[: len(column)])
            if axis == "t" and piece.offset != self.first.offset and numbers.dtype.kind in "iu":
                numbers = numbers.astype(np.int64) + (piece.offset - self.first.offset)
            if axis not in self.joined:
                path = self.request.scratch.path(f"{axis}.joined")
                self.joined[axis] = _Joined(path, numbers.dtype, files.enter_context(path.open("w+b")))
            self.request.scratch.path("", numbers.nbytes)
            self.joined[axis].add(numbers)
        if piece.frames is not None:
            self.stamps.append(np.asarray(piece.frames.stamps))
            self.places += [(member, index) for index in range(len(piece.frames))]

    def pictures(self, remarks: Remarks) -> Frames | None:
        """Those of all pieces; each is opened again for one of its pictures."""
        frames = self.first.frames
        if not self.places or frames is None:
            return None
        if self.store.local_path(self.places[0][0]) is None:
            remarks.detected(f"{len(self.places)} pictures in the pieces are not shown: unpack the archive for them")
            return None

        def read_raw(index: int) -> np.ndarray:
            member, number = self.places[index]
            with ExitStack() as briefly:
                piece = _part(replace(self.request, resources=briefly), self.store, member)
                if piece is None or piece.frames is None or number >= len(piece.frames):
                    raise RecordingError(f"{self.request.name}: {member} was changed while it was open")
                return np.asarray(piece.frames.read_raw(number))

        return replace(frames, stamps=np.concatenate(self.stamps), read_raw=read_raw, flow=None)


def _gathered(request: Request, store: Store, members: list[str]) -> _Gathered:
    """All pieces behind one another in one scratch file for each column."""
    gathered: _Gathered | None = None
    last: float | None = None
    with ExitStack() as files:
        for number, member in enumerate(members):
            request.progress(0.5 * number / len(members))
            with ExitStack() as briefly:
                piece = _part(replace(request, resources=briefly), store, member)
                gathered = gathered or (None if piece is None else _Gathered(request, store, piece))
                if piece is None or gathered is None or not _is_alike(piece, gathered.first):
                    raise RecordingError(f"{request.name}: {member} has other columns than {members[0]}; move it away")
                last = _check_begins_after(piece, last, member, request, gathered.first.offset)
                gathered.add(piece, member, files)
    if gathered is None or any(one.path.stat().st_size == 0 for one in gathered.joined.values()):
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    return gathered


def _is_alike(piece: Piece, first: Piece) -> bool:
    """Whether a piece has the columns, the unit and the sensor of the first one."""
    one, two = ((each.found.order, each.found.unit, set(each.found.columns), each.sensor) for each in (piece, first))
    return one == two


def _check_begins_after(
    piece: Piece, last: float | None, member: str, request: Request, offset: int = 0
) -> float | None:
    """The last stamp of a piece; an error where it begins far before the one before it ends.

    `offset` is that of the first piece.
    """
    t, moved = piece.found.columns["t"], piece.offset - offset
    if len(t) == 0:
        return last
    begin, end = float(np.asarray(t[:1])[0]) + moved, float(np.asarray(t[len(t) - 1 :])[0]) + moved
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


CHUNKS = Format("folder or zip of numbered pieces", ("", ".zip"), _is_chunked, _open)
