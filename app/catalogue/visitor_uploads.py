"""One visitor's files, and one on its way. Each lies in a folder of its own, and goes when its visitor goes.

Nothing here knows how bytes come in: a `Transfer` counts them, from any source, and takes none beyond what was
declared. The visitor's name for a file is only ever shown.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import time
import unicodedata
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import RLock
from typing import Protocol

from app.catalogue.entries import Entry
from app.catalogue.folder import size_of
from etnet.errors import EtnetError
from etnet.events.index_store import BESIDE
from etnet.files import in_megabytes

MEGABYTE = 1_000_000
LONGEST_TITLE = 80
MOST_FILES = 8
"""Files that one visitor may have here at once."""
ALL_VISITORS = 4
"""All visitors together may have so many times what one may have."""
UNPACKED = 4
"""What is made of files (unpacked, indexed, simulated) may have so many times what the files may have."""
TELL_EVERY = 0.15
"""Seconds between two reports of how far a transfer is."""
_SUFFIXES = re.compile(r"(\.[A-Za-z0-9]{1,8}){1,2}$")


class UploadError(EtnetError):
    """A file cannot be taken, or not to its end."""


@dataclass(frozen=True, slots=True)
class HandedOver:
    """One file that is here."""

    id: str
    title: str
    size: str


@dataclass(frozen=True, slots=True)
class UploadsShown:
    """What a page says of its visitor's files. `coming`: name and share (0 … 1) of the one on its way."""

    limit: str
    files: tuple[HandedOver, ...] = ()
    coming: tuple[str, float] | None = None
    refused: str = ""


@dataclass(frozen=True, slots=True)
class UploadLimits:
    """`visitor_bytes` is what one visitor may have here at once, so also the largest file.

    `growth`: what is made of files may have so many times that, one visitor's and all visitors' alike.
    """

    visitor_bytes: int
    total_bytes: int
    visitor_files: int = MOST_FILES
    growth: float = UNPACKED

    @classmethod
    def of_megabytes(cls, megabytes: int) -> UploadLimits:
        """The limits that `--uploads MB` means."""
        return cls(megabytes * MEGABYTE, ALL_VISITORS * megabytes * MEGABYTE)


class UploadRoom(Protocol):
    """What all visitors share: limits, a lock, the disk, and the catalogue that takes their files in."""

    limits: UploadLimits
    lock: RLock
    take_in: Callable[[Entry], None]
    let_go: Callable[[str], None]

    def room(self, desk: VisitorUploads, size: int) -> Path:
        """The visitor's folder, if `size` bytes more fit here at all."""
        ...

    def left_unpacked(self) -> int:
        """Bytes that are left to all visitors for what is made of files."""
        ...

    def leave(self, desk: VisitorUploads) -> None:
        """Forget a visitor with all files."""
        ...


class VisitorUploads:
    """One visitor's files. The page shows its `ticket` with each; nobody else knows it."""

    def __init__(self, uploads: UploadRoom) -> None:
        self.ticket = secrets.token_urlsafe(18)
        self.folder_name = secrets.token_hex(8)
        self.num_bytes = 0
        """Of the files that are here, and of the one on its way in full: it was let in for that."""
        self._uploads = uploads
        self._lock = uploads.lock
        self._files: dict[str, tuple[Entry, int]] = {}
        self._transfer: Transfer | None = None
        self._refused = ""
        self._is_closed = False
        self.on_change: Callable[[str], None] = lambda arrived: None
        """Told on any thread when something changed; with the id of a file that has come, or ""."""

    @property
    def entries(self) -> tuple[Entry, ...]:
        """The files that are here, the newest first."""
        with self._lock:
            return tuple(entry for entry, _ in reversed(self._files.values()))

    @property
    def shown(self) -> UploadsShown:
        """What the page says of them."""
        with self._lock:
            files = tuple(HandedOver(entry.id, entry.title, entry.subtitle) for entry in self.entries)
            coming = self._transfer
            limit = in_megabytes(self._uploads.limits.visitor_bytes)
            return UploadsShown(limit, files, None if coming is None else (coming.title, coming.share), self._refused)

    def begin(self, name: str, size: int) -> Transfer:
        """Let a file of `size` bytes in, or raise UploadError before a single one is taken."""
        title = title_of(name)
        with self._lock:
            try:
                self._check(title, size)
                folder = self._uploads.room(self, size)
                key = secrets.token_hex(12)
                # Indices of a file lie beside it here, so that they go with it.
                (folder / key / BESIDE).mkdir(parents=True)
                begun = Transfer(self, title, folder / key / f"{key}{_suffix(name)}", size, f"upload-{key}")
            except (UploadError, OSError) as error:
                refusal = error if isinstance(error, UploadError) else _not_stored(title, error)
                self.refuse(str(refusal))
                raise refusal from error
            self.num_bytes += size
            self._transfer, self._refused = begun, ""
        self.on_change("")
        return begun

    def _check(self, title: str, size: int) -> None:
        limits = self._uploads.limits
        if self._is_closed:
            raise UploadError("the page that sends this file is not open any more; load it again")
        if self._transfer is not None:
            raise UploadError(f"{title}: another file is on its way; wait for it, or stop it")
        if size < 1:
            raise UploadError(f"{title}: an empty file; there is nothing to open")
        if size > limits.visitor_bytes:
            raise UploadError(
                f"{title}: {in_megabytes(size)}, this viewer takes {in_megabytes(limits.visitor_bytes)}; put it into "
                "a folder and start the viewer with --data FOLDER, where any size opens"
            )
        if len(self._files) >= limits.visitor_files:
            raise UploadError(f"{title}: {len(self._files)} files are here already; remove one first")
        if self.num_bytes + size > limits.visitor_bytes:
            left = in_megabytes(limits.visitor_bytes - self.num_bytes)
            raise UploadError(f"{title}: {in_megabytes(size)}, {left} are left; remove a file first")
        self.check_unpacked(title, size)

    @property
    def awaited_bytes(self) -> int:
        """Of the file on its way, what has yet to come: it was let in for that, and the disk does not show it."""
        coming = self._transfer
        return 0 if coming is None else coming.size - coming.received

    @property
    def unpacked_bytes(self) -> int:
        """Of all that was made of the files that are here, as it lies on the disk."""
        with self._lock:
            paths = [entry.path for entry, _ in self._files.values()]
        return sum(_size_beside(path) for path in paths)

    @property
    def left_unpacked(self) -> int:
        """Bytes that what is made of this visitor's files may still have; below 0 where it has more."""
        limits = self._uploads.limits
        own = int(limits.growth * limits.visitor_bytes) - self.unpacked_bytes
        return min(own, self._uploads.left_unpacked())

    def check_unpacked(self, name: str, size: int = 0) -> None:
        """An error about the file `name` where `size` bytes more, made of this visitor's files, have no room."""
        if self.left_unpacked < size:
            most = in_megabytes(int(self._uploads.limits.growth * self._uploads.limits.visitor_bytes))
            raise UploadError(
                f"{name}: what is unpacked, indexed or simulated of the files here has no room beyond {most}, less "
                "where others have theirs; remove a file first"
            )

    def refuse(self, why: str) -> None:
        """Say why a file did not come."""
        with self._lock:
            self._refused = why
        self.on_change("")

    def remove(self, entry_id: str) -> None:
        """A file is not wanted any more; nothing where it is not this visitor's."""
        with self._lock:
            entry, size = self._files.pop(entry_id, (None, 0))
            self.num_bytes -= size
        if entry is not None:
            self._forget(entry)
            self.on_change("")

    def clear(self) -> None:
        """The next visitor of this page must not see what was here."""
        with self._lock:
            self._refused = ""
        for entry in self.entries:
            self.remove(entry.id)

    def close(self) -> None:
        """The visitor has gone: the files go, and all that was made of them."""
        with self._lock:
            self._is_closed = True
            gone = [entry for entry, _ in self._files.values()]
            self._files, self.num_bytes = {}, 0
        self._uploads.leave(self)
        for entry in gone:
            self._forget(entry)

    def _forget(self, entry: Entry) -> None:
        shutil.rmtree(entry.path.parent, ignore_errors=True)
        self._uploads.let_go(entry.id)

    def ended(self, transfer: Transfer, entry: Entry | None) -> None:
        """A transfer has come to its end, or was cut off (`None`)."""
        with self._lock:
            if self._transfer is transfer:
                self._transfer = None
            if entry is None or self._is_closed:
                self.num_bytes = max(self.num_bytes - transfer.size, 0)
                shutil.rmtree(transfer.path.parent, ignore_errors=True)
                is_here = False
            else:
                self._files[entry.id] = (entry, transfer.size)
                self._uploads.take_in(entry)
                is_here = True
        self.on_change(entry.id if entry is not None and is_here else "")

    @property
    def is_closed(self) -> bool:
        """Whether the visitor has gone."""
        return self._is_closed


class Transfer:
    """A file on its way, on disk as far as it came. Used by one thread at a time."""

    def __init__(self, desk: VisitorUploads, title: str, path: Path, size: int, entry_id: str) -> None:
        self.title, self.path, self.size = title, path, size
        self.received = 0
        self._desk = desk
        self._id = entry_id
        self._told_at = 0.0
        self._file = os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb")
        self._is_over = False

    @property
    def share(self) -> float:
        """How much of it is here, 0 … 1."""
        return self.received / self.size

    def take(self, chunk: bytes) -> None:
        """Write some more of it. What goes beyond the declared size is never written; raises UploadError."""
        if self._desk.is_closed:
            raise UploadError("its visitor has gone")
        if self.received + len(chunk) > self.size:
            raise UploadError(f"{self.title}: more came than the {self.size:,} bytes it was said to have; cut off")
        try:
            self._file.write(chunk)
        except OSError as error:
            raise _not_stored(self.title, error) from error
        self.received += len(chunk)
        if time.monotonic() - self._told_at > TELL_EVERY:
            self._told_at = time.monotonic()
            self._desk.on_change("")

    def finish(self) -> str:
        """All of it is here; the id by which it can be opened. Raises UploadError where some is missing."""
        if self.received != self.size:
            raise UploadError(f"{self.title}: {self.received:,} of {self.size:,} bytes came; send it again")
        self._is_over = True
        try:
            self._file.close()  # writes what waits in memory
            said = f"yours, {size_of(self.path)}"
        except OSError as error:
            refusal = _not_stored(self.title, error)
            self._give_up(str(refusal))
            raise refusal from error
        entry = Entry(self._id, self.title, "upload", said, self.path, unpacking=self._desk)
        self._desk.ended(self, entry)
        return entry.id

    def abort(self, why: str) -> None:
        """Whatever came of it goes; nothing where it is whole."""
        if self._is_over:
            return
        self._is_over = True
        self._give_up(why)

    def _give_up(self, why: str) -> None:
        with contextlib.suppress(OSError):  # what waits in memory may have no room; it is not wanted any more
            self._file.close()
        self._desk.ended(self, None)
        self._desk.refuse(why)


def _not_stored(title: str, error: OSError) -> UploadError:
    return UploadError(f"{title}: cannot be stored here ({error.strerror}); try again later")


def _size_beside(path: Path) -> int:
    """Bytes of all files in a file's folder but its own; what goes meanwhile counts nothing."""
    total = 0
    for folder, _, names in os.walk(path.parent):
        for name in names:
            if (each := Path(folder, name)) != path:
                with contextlib.suppress(OSError):
                    total += each.lstat().st_size
    return total


def title_of(name: str) -> str:
    """A visitor's name for a file, as it may be shown: one line without signs that steer text, of bounded length."""
    base = re.split(r"[/\\]", name)[-1]
    plain = "".join(sign for sign in base if unicodedata.category(sign)[0] != "C").strip()
    if len(plain) > LONGEST_TITLE:
        plain = f"{plain[: LONGEST_TITLE - 20]}…{plain[-16:]}"
    return plain or "a file without a name"


def _suffix(name: str) -> str:
    """The part of a name that helps to tell its format: letters and digits alone."""
    found = _SUFFIXES.search(name)
    return found[0].lower() if found else ""
