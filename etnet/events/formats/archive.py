"""Files inside a folder or a zip archive, read without letting either one harm the machine."""

from __future__ import annotations

import os
import stat
import zipfile
from contextlib import ExitStack
from io import BufferedIOBase
from pathlib import Path
from threading import Lock
from typing import Protocol, cast, runtime_checkable

from etnet.errors import RecordingError
from etnet.events.formats.bounds import MAX_SMALL_FILE, at_most, is_bomb

MAX_MEMBERS = 200_000


def is_litter(name: str) -> bool:
    """What a Mac leaves in folders and archives: nothing of the recording's, under names that look like it."""
    last = name.rsplit("/", 1)[-1]
    return name.startswith("__MACOSX/") or last.startswith("._") or last == ".DS_Store"


@runtime_checkable
class Store(Protocol):
    """Named files."""

    def names(self) -> tuple[str, ...]:
        """All files, with "/" between folders, sorted."""
        ...

    def size(self, name: str) -> int:
        """Bytes of a file."""
        ...

    def open(self, name: str) -> BufferedIOBase:
        """A stream from the file's start."""
        ...

    def local_path(self, name: str) -> Path | None:
        """Where the file lies by itself, if it does."""
        ...


class FolderStore:
    """A folder. Links that lead out of it are refused."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder.resolve()
        self._label = folder.name
        self._signs: dict[str, Sign] = {}
        """Of each file that was listed or opened, as it was then."""

    def names(self) -> tuple[str, ...]:
        """Files of the folder and of folders in it, three levels deep at most."""
        found: list[str] = []
        for pattern in ("*", "*/*", "*/*/*", "*/*/*/*"):
            for path in self._folder.glob(pattern):
                name = path.relative_to(self._folder).as_posix()
                if (sign := _sign_of_file(path)) is not None and not is_litter(name):
                    self._signs.setdefault(name, sign)
                    found.append(name)
                if len(found) > MAX_MEMBERS:
                    raise RecordingError(
                        f"{self._label}: more than {MAX_MEMBERS} files; name the recording's own folder"
                    )
        return tuple(sorted(found))

    def size(self, name: str) -> int:
        """Bytes of a file."""
        return self._inside(name).stat().st_size

    def open(self, name: str) -> BufferedIOBase:
        """A stream from the file's start. An error where it is not the file any more that was listed."""
        stream = self._inside(name).open("rb")
        sign = sign_of(os.fstat(stream.fileno()))
        if self._signs.setdefault(name, sign) != sign:
            stream.close()
            raise RecordingError(f"{self._label}: {name} was changed while the recording was open; open it again")
        return stream

    def local_path(self, name: str) -> Path:
        """The file's own path."""
        return self._inside(name)

    def _inside(self, name: str) -> Path:
        path = (self._folder / name).resolve()
        if not path.is_relative_to(self._folder):
            raise RecordingError(f"{self._label}: {name} leads out of the folder; copy the file into it")
        if not path.is_file():
            raise RecordingError(f"{self._label}: {name} is missing or no regular file")
        return path


Sign = tuple[int, int, int]


def sign_of(status: os.stat_result) -> Sign:
    """What is another one when a file was written to, or when it is another file."""
    return status.st_ino, status.st_size, status.st_mtime_ns


def _sign_of_file(path: Path) -> Sign | None:
    """None for what is no regular file, or has gone."""
    try:
        status = path.stat()
    except OSError:
        return None
    return sign_of(status) if stat.S_ISREG(status.st_mode) else None


class ZipStore:
    """A zip archive, never unpacked as a whole. Python's zipfile stops at a member's declared size."""

    def __init__(self, path: Path, resources: ExitStack) -> None:
        self._label = path.name
        try:
            self._archive = resources.enter_context(zipfile.ZipFile(path))
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError) as slip:
            raise RecordingError(f"{path.name}: no readable zip archive ({slip}); it may be truncated") from slip
        self._lock = Lock()
        members = self._archive.infolist()
        if len(members) > MAX_MEMBERS:
            raise RecordingError(f"{path.name}: {len(members)} members; at most {MAX_MEMBERS} are read")
        # Some programs on Windows write the folders of a name with backslashes. A damaged archive may name nothing.
        named = ((member.filename.replace("\\", "/"), member) for member in members)
        self._members = {
            name: member for name, member in named if name and not is_litter(name) and not name.endswith("/")
        }
        for member in self._members.values():
            if is_bomb(member.compress_size, member.file_size):
                raise RecordingError(
                    f"{path.name}: {member.filename} would grow from {member.compress_size} to {member.file_size} "
                    "bytes, like a zip bomb; unpack it by hand, or allow it with --unpack-limit MB, if you trust it"
                )

    def names(self) -> tuple[str, ...]:
        """All members."""
        return tuple(sorted(self._members))

    def size(self, name: str) -> int:
        """Declared bytes of a member."""
        return self._members[name].file_size

    def open(self, name: str) -> BufferedIOBase:
        """A stream of the unpacked member."""
        if self._members[name].flag_bits & 1:
            raise RecordingError(f"{self._label}: {name} is encrypted; unpack it by hand")
        with self._lock:
            return cast(BufferedIOBase, self._archive.open(self._members[name]))

    def local_path(self, name: str) -> Path | None:
        """A member has no path of its own."""
        return None


class TooLarge(RecordingError):
    """A file that is larger than what is read whole."""


def read_small(store: Store, name: str, label: str) -> bytes:
    """A whole small file: a picture, a table of stamps, a piece of metadata."""
    most = at_most(MAX_SMALL_FILE)
    if store.size(name) > most:
        raise TooLarge(
            f"{label}: {name} has {store.size(name)} bytes; at most {most} are expected there: allow more with "
            "--unpack-limit MB, if you trust it"
        )
    with store.open(name) as stream:
        return stream.read(most + 1)
