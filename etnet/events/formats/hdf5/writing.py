"""HDF5 files that are written from start to end: a disk that is full is an error, and no signal that ends the process.

HDF5 crashes the interpreter when a write fails (2.0: in the next flush or close). So it writes through a file object
that never fails, and the caller asks it after every part.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py

from etnet.events.formats.hdf5.at_exit import close_at_exit

METADATA_BYTES = 1 << 18
"""Of headers of datasets that HDF5 holds; what it allocates for them is twenty times as much."""


def bound_metadata(file: h5py.File) -> None:
    """Let headers go to the disk early: a dataset a camera frame adds up, with HDF5's own 32 MB to hundreds of MB."""
    config = file.id.get_mdc_config()
    config.set_initial_size = True
    config.initial_size = config.max_size = METADATA_BYTES
    config.min_size = METADATA_BYTES // 2
    file.id.set_mdc_config(config)


class WrittenFile(h5py.File):
    """A file of which `check` says, after each part, whether the disk took it."""

    target: _NeverFails

    def __init__(self, *where: Any, **options: Any) -> None:
        super().__init__(*where, **options)
        bound_metadata(self)

    def check(self) -> None:
        """Raise the OSError of the first write that failed; what comes after that is held in memory."""
        if self.target.error is not None:
            raise self.target.error


@contextmanager
def hdf5_to_write(path: Path, **options: Any) -> Iterator[WrittenFile]:
    """A new HDF5 file.

    Raises:
        OSError: it could not be written; what lies at `path` is then of no use.
    """
    with _NeverFails(path) as target:
        with WrittenFile(target, "w", **options) as file:
            file.target = target
            yield file
        if target.error is not None:
            raise target.error


def written_file(path: Path, **options: Any) -> WrittenFile:
    """A new HDF5 file that stays open for as long as anybody reads it; `check` says whether the disk took it."""
    target = _NeverFails(path)
    file = WrittenFile(target, "w", **options)
    file.target = target
    return file


class _NeverFails(io.RawIOBase):
    """Writes straight to a file; from the first write that fails on, all of it goes to memory and is thrown away."""

    def __init__(self, path: Path) -> None:
        close_at_exit()
        self._descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0), 0o666)
        self._place = 0
        self._kept: dict[int, bytes] = {}
        self.error: OSError | None = None

    def readinto(self, buffer: Any) -> int:
        """As written, what was only kept included."""
        wanted = memoryview(buffer).cast("B")
        found = os.pread(self._descriptor, len(wanted), self._place)
        wanted[:] = found + bytes(len(wanted) - len(found))
        stop = self._place + len(wanted)
        for start, content in self._kept.items():
            first, last = max(start, self._place), min(start + len(content), stop)
            if first < last:
                wanted[first - self._place : last - self._place] = content[first - start : last - start]
        self._place = stop
        return len(wanted)

    def write(self, content: Any) -> int:
        """All of it, wherever it goes."""
        data = bytes(content)
        if self.error is None:
            try:
                done = 0
                while done < len(data):
                    done += os.pwrite(self._descriptor, data[done:], self._place + done)
            except OSError as error:
                self.error = error
                self._kept[self._place] = data
        else:
            self._kept[self._place] = data
        self._place += len(data)
        return len(data)

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """As of any file."""
        end = os.fstat(self._descriptor).st_size
        end = max(end, *(start + len(data) for start, data in self._kept.items()), 0) if self._kept else end
        self._place = place + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: end}[whence]
        return self._place

    def tell(self) -> int:
        """As of any file."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """As of any file."""
        size = self._place if size is None else size
        if self.error is None:
            try:
                os.ftruncate(self._descriptor, size)
            except OSError as error:
                self.error = error
        return size

    def close(self) -> None:
        """The descriptor goes."""
        if not self.closed:
            os.close(self._descriptor)
        super().close()
