"""An HDF5 file that can be killed while it is written and still opens as it was at its last commit.

HDF5 overwrites its own tables in place, so a process that dies in between leaves a file that cannot be read. Here what
is new goes to the end of the file, where nothing points yet, and what is overwritten waits until `commit`. It is then
written to a journal beside the file first, which `restore` plays again if the process died while it was at it. The
writer holds a lock on its journal, which goes with the process, so that a reader leaves it to a writer that lives.
A failed write crashes HDF5, so it never hears of one: what the disk did not take is held, and `commit` raises.
"""

from __future__ import annotations

import io
import os
import struct
import time
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO, BinaryIO

from etnet.errors import RecordingError
from etnet.events.formats.hdf5.at_exit import close_at_exit
from etnet.files import in_megabytes, replacing

_MAGIC = b"etnetH5J"
_LARGEST = 1 << 30
_PATIENCE = 2.0
"""Seconds that a reader waits for a commit to end; it takes some milliseconds."""
_PAUSE = 0.005


def journal_of(path: Path) -> Path:
    """Where the journal of a file lies while there is one."""
    return path.with_name(path.name + ".journal")


class CommittedFile(io.RawIOBase):
    """What h5py takes in place of a path. Only `commit` changes what an earlier commit wrote."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        close_at_exit()
        self._path = path
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | getattr(os, "O_BINARY", 0), 0o644)
        journal_of(path).unlink(missing_ok=True)
        self._place, self._size, self._committed = 0, 0, 0
        self._waiting: dict[tuple[int, int], bytes] = {}
        self._error: OSError | None = None
        """Of the first write that failed: from then on the file stays as the last commit left it."""

    def readable(self) -> bool:
        """HDF5 reads its own tables back."""
        return True

    def writable(self) -> bool:
        """It is there to be written."""
        return True

    def seekable(self) -> bool:
        """HDF5 jumps."""
        return True

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        self._place = place + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._size}[whence]
        return self._place

    def tell(self) -> int:
        """The place."""
        return self._place

    def truncate(self, size: int | None = None) -> int:
        """The size that HDF5 wants; the file itself gets it with the next commit."""
        self._size = self._place if size is None else size
        return self._size

    def readinto(self, buffer) -> int:
        """What was written last, whether it waits or not."""
        view = memoryview(buffer).cast("B")
        start, stop = self._place, self._place + len(view)
        content = os.pread(self._file, len(view), start).ljust(len(view), b"\0")
        view[:] = content
        for (place, length), waiting in self._waiting.items():
            first, last = max(start, place), min(stop, place + length)
            if first < last:
                view[first - start : last - start] = waiting[first - place : last - place]
        self._place = stop
        return len(view)

    def write(self, content) -> int:
        """New bytes go to the file, bytes in place of committed ones wait."""
        data = bytes(content)
        old = max(0, min(self._committed - self._place, len(data)))
        if old:
            self._hold(data[:old], self._place)
        if old < len(data):
            self._append(data[old:], self._place + old)
        self._place += len(data)
        self._size = max(self._size, self._place)
        return len(data)

    def flush(self) -> None:
        """Nothing yet: see `commit`."""

    def _append(self, data: bytes, place: int) -> None:
        if self._error is None:
            try:
                _write_all(self._file, data, place)
            except OSError as error:
                self._error = error
            else:
                return
        self._hold(data, place)

    def _hold(self, data: bytes, place: int) -> None:
        key = place, len(data)
        self._waiting.pop(key, None)  # so that the last one written is the last one applied
        self._waiting[key] = data

    def commit(self) -> None:
        """From here on the file is what HDF5 wrote up to now. Call it when HDF5 has flushed.

        Raises:
            OSError: the disk did not take all of it; the file is what it was at the last commit.
            EtnetError: it did not take the journal.
        """
        if self._error is not None:
            raise self._error
        if self._waiting:
            journal = journal_of(self._path)
            parts = [struct.pack("<QQ", *key) + content for key, content in self._waiting.items()]
            body = struct.pack("<QQ", self._size, len(parts)) + b"".join(parts)
            with _held(journal, _MAGIC + body + struct.pack("<I", zlib.crc32(body))):
                for (place, _), content in self._waiting.items():
                    _write_all(self._file, content, place)
                self._waiting.clear()
                journal.unlink(missing_ok=True)
        self._committed = self._size

    def close(self) -> None:
        """Commit what HDF5 wrote when it closed, and close the file."""
        if not self.closed:
            try:
                self.commit()
                os.ftruncate(self._file, self._size)
            except OSError as error:
                self._error = error
                if not journal_of(self._path).exists():
                    os.ftruncate(self._file, self._committed)  # what came after it is of no use
                raise
            finally:
                os.close(self._file)
                super().close()


def restore(path: Path) -> bool:
    """Finish the commit in which the writer of `path` died, if it did; whether there was one.

    A writer that lives finishes its own: it is waited for, and nothing is played.
    """
    journal = journal_of(path)
    if not journal.is_file():
        return False
    try:
        with _abandoned(journal) as left:
            return left is not None and _play(left, journal, path)
    except (OSError, struct.error) as error:
        raise RecordingError(
            f"{path.name}: its writer was stopped, and {journal.name} cannot be played again ({error}); "
            "copy both to a folder where they can be written"
        ) from error


def _play(left: BinaryIO, journal: Path, path: Path) -> bool:
    """Write the parts of a journal to where they belong, and remove it; whether it is whole."""
    if os.fstat(left.fileno()).st_size > _LARGEST:
        raise RecordingError(f"{journal.name}: a journal of more than {in_megabytes(_LARGEST)}; remove it")
    content = left.read()
    body, check = content[len(_MAGIC) : -4], content[-4:]
    if content[: len(_MAGIC)] != _MAGIC or len(check) < 4 or zlib.crc32(body) != struct.unpack("<I", check)[0]:
        return False
    _, num_parts = struct.unpack_from("<QQ", body)
    place = 16
    with path.open("r+b") as file:
        for _ in range(num_parts):
            at, length = struct.unpack_from("<QQ", body, place)
            file.seek(at)
            file.write(body[place + 16 : place + 16 + length])
            place += 16 + length
    journal.unlink(missing_ok=True)
    return True


@contextmanager
def _held(journal: Path, content: bytes) -> Iterator[None]:
    """A whole journal, locked from before it appears until the block ends."""
    with ExitStack() as until_then:
        with replacing(journal, flushes=False) as beside:
            file = until_then.enter_context(beside.open("wb"))
            with suppress(OSError):  # a file system without locks
                _lock(file, is_shared=False)
            file.write(content)
            file.flush()
        yield


@contextmanager
def _abandoned(journal: Path) -> Iterator[BinaryIO | None]:
    """The journal of a writer that died, locked; None where it lives, or is done by now."""
    deadline = time.monotonic() + _PATIENCE
    try:
        file = journal.open("rb")
    except FileNotFoundError:
        yield None
        return
    with file:
        is_free = False
        while not is_free and time.monotonic() < deadline:
            try:
                _lock(file, is_shared=True)  # one alone would need a file that is open for writing, over NFS
                is_free = True
            except BlockingIOError:
                time.sleep(_PAUSE)
            except OSError:
                is_free = True  # a file system without locks
        # One that was removed is of a commit that ended: to play it would undo what came after it.
        yield file if is_free and os.fstat(file.fileno()).st_nlink else None


def _lock(file: IO[bytes], is_shared: bool) -> None:
    """For as long as it is open, or the process lives.

    Raises:
        BlockingIOError: another one has it.
    """
    try:
        import fcntl
    except ImportError:
        return  # not a POSIX system
    fcntl.flock(file, (fcntl.LOCK_SH if is_shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


def _write_all(file: int, content: bytes, place: int) -> None:
    view = memoryview(content)
    while view:
        written = os.pwrite(file, view, place)
        view, place = view[written:], place + written
