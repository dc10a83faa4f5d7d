"""Where decoded events and frames lie: in memory below a cap, beyond it in files of a scratch folder that goes away."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Int8, Int64, Shaped, UInt16

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.files import in_megabytes
from etnet.private_folder import PrivateFolder

MEMORY_CAP = 256 << 20
"""Bytes of decoded events, and as many of frames, that one recording holds in memory."""

BYTES_PER_EVENT = 13

_COLUMNS = (("x", np.uint16), ("y", np.uint16), ("t", np.int64), ("p", np.int8))
_SPARE_DISK = 64 << 20
_SORT_BLOCK = 1 << 20
_KEPT_HEAP = 16 << 20


class Columns(NamedTuple):
    """Events that are not yet tied to a sensor; t in µs, p ∈ {−1, +1}."""

    x: UInt16[np.ndarray, " n"]
    y: UInt16[np.ndarray, " n"]
    t: Int64[np.ndarray, " n"]
    p: Int8[np.ndarray, " n"]


class Scratch:
    """A temporary folder, made at the first need and removed on `close`, on collection, or when Python ends."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._folder: PrivateFolder | None = None

    def path(self, file: str, num_bytes: int = 0) -> Path:
        """A path in the folder for a file that will grow by `num_bytes`; an error if the disk has no room for it."""
        if self._folder is None:
            self._folder = PrivateFolder("etnet-scratch-")
        folder = self._folder.path
        free = shutil.disk_usage(folder).free
        if free < num_bytes + _SPARE_DISK:
            raise RecordingError(
                f"{self._name}: decoded it needs {in_megabytes(num_bytes)} more in {folder.parent}, where "
                f"{in_megabytes(free)} are free; make room there or point TMPDIR to a larger disk"
            )
        return folder / file

    def close(self) -> None:
        """Remove the folder and all in it."""
        if self._folder is not None:
            self._folder.close()


class EventCache:
    """Takes events in pieces and gives them back as four whole columns.

    The buffer is as large as the cap from the start: memory that is never touched costs nothing, and no event is copied
    twice. When it is full, it goes to the scratch files and is filled again.
    """

    def __init__(self, scratch: Scratch) -> None:
        self.scratch = scratch
        self.num_events = 0
        self._num_held = 0
        self._is_spilled = False
        self.capacity = max(1, MEMORY_CAP // BYTES_PER_EVENT)
        # glibc gives freed memory back to the system beyond twice the largest piece that was freed before. A decoder
        # asks for its few megabytes again with every block: without this, half of its time is faulting them in again.
        np.empty(_KEPT_HEAP, np.uint8)
        self._buffer = Columns(*(np.empty(self.capacity, dtype) for _, dtype in _COLUMNS))

    def room(self, num_events: int) -> Columns:
        """Columns of so many events (at most `capacity`), to be filled and then kept."""
        if self._num_held + num_events > self.capacity:
            self._spill()
        span = slice(self._num_held, self._num_held + num_events)
        return Columns(*(column[span] for column in self._buffer))

    def keep(self, num_events: int) -> None:
        """The first so many events of the room that was given last are there to stay."""
        self._num_held += num_events
        self.num_events += num_events

    def columns(self) -> Columns:
        """All events so far, in memory or as maps of the scratch files."""
        if not self._is_spilled:
            return Columns(*(column[: self._num_held] for column in self._buffer))
        self._spill()
        return Columns(*(np.memmap(self.scratch.path(name), dtype, "r") for name, dtype in _COLUMNS))

    def map_stamps(self, change: Callable[[Int64[np.ndarray, " n"]], Int64[np.ndarray, " n"]]) -> None:
        """Replace all stamps by what `change` makes of them, a block at a time."""
        if self._is_spilled:
            self._spill()
        stamps = np.memmap(self.scratch.path("t"), np.int64, "r+") if self._is_spilled else self._buffer.t
        count = len(stamps) if self._is_spilled else self._num_held
        for start in range(0, count, _SORT_BLOCK):
            part = slice(start, min(start + _SORT_BLOCK, count))
            stamps[part] = change(np.array(stamps[part]))

    def sorted_columns(self) -> Columns:
        """All events in the order of their stamps; equal stamps keep the file's order."""
        columns = self.columns()
        order = np.argsort(columns.t, kind="stable")
        if not self._is_spilled:
            return Columns(*(column[order] for column in columns))
        return Columns(*(self._write_sorted(i, columns[i], order) for i in range(4)))

    def _write_sorted(self, i: int, column: Shaped[np.ndarray, " n"], order: Int64[np.ndarray, " n"]) -> np.ndarray:
        name, dtype = _COLUMNS[i]
        path = self.scratch.path(f"{name}.sorted", column.nbytes)
        with path.open("wb") as file:
            for start in range(0, len(order), _SORT_BLOCK):
                column[order[start : start + _SORT_BLOCK]].tofile(file)
        return np.memmap(path, dtype, "r")

    def _spill(self) -> None:
        need = self._num_held * BYTES_PER_EVENT
        for (name, _), column in zip(_COLUMNS, self._buffer, strict=True):
            with self.scratch.path(name, need).open("ab") as file:
                column[: self._num_held].tofile(file)
        self._num_held, self._is_spilled = 0, True


@dataclass(frozen=True, slots=True)
class ColumnSource:
    """Decoded columns, in memory or mapped."""

    columns: Columns
    sensor: Sensor

    @property
    def num_events(self) -> int:
        """How many events there are."""
        return len(self.columns.t)

    def read(self, start: int, stop: int) -> Events:
        """A view of the columns, nothing copied."""
        x, y, t, p = (np.asarray(column[start:stop]) for column in self.columns)
        return Events(x, y, t, p, self.sensor)

    def close(self) -> None:
        """The scratch folder belongs to the one who made it."""


@dataclass
class FrameCache:
    """Frames of one shape and type, kept as they came; beyond the cap they lie in a scratch file."""

    scratch: Scratch
    file: str = "frames"
    _frames: list[np.ndarray] = field(default_factory=list)
    _num_bytes: int = 0
    _num_spilled: int = 0

    def append(self, frame: Shaped[np.ndarray, ...]) -> None:
        """Keep a frame; all must be alike."""
        self._frames.append(frame)
        self._num_bytes += frame.nbytes
        if self._num_bytes > MEMORY_CAP:
            with self.scratch.path(self.file, self._num_bytes).open("ab") as file:
                for held in self._frames:
                    held.tofile(file)
            self._num_spilled += len(self._frames)
            self._like = self._frames[0]
            self._frames, self._num_bytes = [], 0

    def drop(self) -> None:
        """Give up all frames."""
        if self._num_spilled:
            self.scratch.path(self.file).unlink()
        self._frames, self._num_bytes, self._num_spilled = [], 0, 0

    def __len__(self) -> int:
        return self._num_spilled + len(self._frames)

    def __getitem__(self, index: int) -> Shaped[np.ndarray, ...]:
        """The frame as it came."""
        if index >= self._num_spilled:
            return self._frames[index - self._num_spilled]
        shape, dtype = self._like.shape, self._like.dtype
        return np.fromfile(
            self.scratch.path(self.file), dtype, int(np.prod(shape)), offset=index * self._like.nbytes
        ).reshape(shape)


def grey(frame: Shaped[np.ndarray, ...], *, is_bgr: bool = False) -> Float32[np.ndarray, "h w"]:
    """Any picture as luminance in 0 … 1 (ITU-R BT.601 weights); whole numbers are divided by their type's maximum."""
    maximum = np.float32(np.iinfo(frame.dtype).max if frame.dtype.kind == "u" else 1)
    if frame.ndim == 2:
        return frame.astype(np.float32) / maximum
    if frame.shape[2] < 3:
        return frame[..., 0].astype(np.float32) / maximum
    weights = np.array([0.114, 0.587, 0.299] if is_bgr else [0.299, 0.587, 0.114], np.float32)
    return (frame[..., :3].astype(np.float32) @ weights) / maximum
