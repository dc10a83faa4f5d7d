"""Files that are written: whole or not at all, never over anything but a regular file; their names and sizes in words;
and where the cache lies."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shutil
import socket
import tempfile
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from etnet.errors import EtnetError

UNFINISHED = "unfinished"
"""What a temporary file's name has: `.<target>.<process>-<node>.<random>.unfinished<suffix>`."""
_DISK_FAULTS = (errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC), errno.EIO, errno.EROFS)
_WITHOUT_LOCKS = {
    getattr(errno, name) for name in ("ENOSYS", "ENOLCK", "ENOTSUP", "EOPNOTSUPP") if hasattr(errno, name)
}
"""How a file system says that it has no locks."""
_LEFT = re.compile(rf"\..*\.([0-9]+)(?:-([0-9a-f]{{8}}))?\.[0-9a-f]{{8}}\.{UNFINISHED}.*", re.DOTALL)
_ABANDONED = 86_400
"""Seconds without a change after which what was written on another node is taken for that of a process that ended."""


def check_target(path: Path) -> None:
    """An error if something other than a regular file lies at `path`: to move a file there would destroy it.

    A folder, a pipe or a device, and a link to one; where there is nothing, a file can be written.
    """
    if path.exists() and not path.is_file():
        raise EtnetError(f"{printable(path)}: is there already and is no regular file; choose another name")


@contextmanager
def replacing(path: Path, flushes: bool = True, suffix: str = "") -> Iterator[Path]:
    """A path beside `path`, ending in `suffix`, for a file that takes its place once the block has ended well.

    It is flushed to the disk first, unless it can be made again. After an error, and after a kill at the next use,
    nothing of it is left.

    Raises:
        EtnetError: it cannot be written, for example because the disk is full.
    """
    check_target(path)
    _sweep_once(path.parent)
    beside = _beside(path, suffix)
    try:
        yield beside
        if flushes:
            _flush(beside)
        os.replace(beside, path)
    except OSError as error:
        raise cannot_write(path, error) from error
    except Exception as error:
        if isinstance(error, EtnetError) or (cause := _of_the_disk(error)) is None:
            raise
        raise cannot_write(path, cause) from error
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)


@contextmanager
def working_folder(path: Path) -> Iterator[Path]:
    """A folder beside `path` to make it in. It goes in the end; after a kill, at the next use in that place."""
    _sweep_once(path.parent)
    beside = _beside(path, "")
    try:
        beside.mkdir(parents=True)
        yield beside
    except OSError as error:
        raise cannot_write(path, error) from error
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def replace_folder(made: Path, path: Path, flushes: bool = False) -> None:
    """Put a whole folder in the place of another one, or of none; both lie on one disk."""
    if flushes:
        for file in made.rglob("*"):
            if file.is_file():
                _flush(file)
    former = _beside(path, "")
    if path.exists():
        os.replace(path, former)
    os.replace(made, path)
    shutil.rmtree(former, ignore_errors=True)


def write_atomically(path: Path, content: bytes, flushes: bool = True) -> None:
    """Write a whole file or nothing (see `replacing`)."""
    with replacing(path, flushes) as beside:
        beside.write_bytes(content)


@contextmanager
def claimed(lock: Path) -> Iterator[bool]:
    """Whether this process alone works on what `lock` stands for, while the block lasts.

    The file `lock` is made for it, and stays. The claim goes with the process that has it, however it ends. Where the
    file system has no locks nothing tells of others, and all may work.
    """
    try:
        import fcntl
    except ImportError:
        # Not a POSIX system: nothing tells whether another process is at it.
        yield True
        return
    with lock.open("w") as claim:
        try:
            fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            yield False
            return
        except OSError as error:
            if error.errno not in _WITHOUT_LOCKS:
                raise
        yield True


def cannot_write(path: Path, error: OSError) -> EtnetError:
    """The error of the system in one line, with what to do."""
    why = error.strerror or str(error)
    return EtnetError(f"{printable(path.name)}: cannot be written ({why}); make room, or choose another place")


def sweep_unfinished(folder: Path) -> None:
    """Remove what processes that are gone were writing in a folder (see `replacing`).

    Whether one of another node is gone nothing tells but time.
    """
    with contextlib.suppress(OSError):
        for left in folder.iterdir():
            found = _LEFT.fullmatch(left.name)
            if found is None:
                continue
            with contextlib.suppress(OSError):
                if _has_ended(int(found[1])) if found[2] == _node() else _is_abandoned(left):
                    shutil.rmtree(left) if left.is_dir() else left.unlink()


def cache_folder() -> Path:
    """Where everything lies that can be made again: ETNET_CACHE, or `etnet` in the user's cache folder."""
    if "ETNET_CACHE" in os.environ:
        return Path(os.environ["ETNET_CACHE"])
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "etnet"
    except RuntimeError:
        # A user without a home, as in some containers.
        return Path(tempfile.gettempdir()) / "etnet"


def printable(name: object) -> str:
    """A name as it can be shown and sent: bytes that are not UTF-8 are escaped, as \\xff."""
    text = str(name)
    try:
        text.encode()
    except UnicodeEncodeError:
        return text.encode("utf-8", "surrogateescape" if _is_name(text) else "backslashreplace").decode(
            "utf-8", "backslashreplace"
        )
    return text


def in_megabytes(num_bytes: int) -> str:
    """Bytes in words: 1,234.5 MB of a million bytes, below 0.1 MB in kB.

    Rounded up, so that what is too large never reads as what is allowed.
    """
    if num_bytes < 100_000:
        return f"{-(-num_bytes // 100) / 10:,.1f}".removesuffix(".0") + " kB"
    return f"{-(-num_bytes // 100_000) / 10:,.1f}".removesuffix(".0") + " MB"


def _of_the_disk(error: BaseException) -> OSError | None:
    """The system's word behind an error of a library that wrote: torch says "unexpected pos" of a full disk."""
    context: BaseException | None = error
    while context is not None:
        if isinstance(context, OSError) and context.errno in _DISK_FAULTS:
            return context
        context = context.__cause__ or context.__context__
    return None


def _beside(path: Path, suffix: str) -> Path:
    return path.with_name(f".{path.name[:60]}.{os.getpid()}-{_node()}.{secrets.token_hex(4)}.{UNFINISHED}{suffix}")


def _flush(path: Path) -> None:
    """Ask the disk for what was written; a full one may say so only now."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@lru_cache(maxsize=256)
def _sweep_once(folder: Path) -> None:
    """A folder of many files is looked through once a process."""
    sweep_unfinished(folder)


@lru_cache(maxsize=1)
def _node() -> str:
    """A mark of where process ids mean what they mean here: this machine since its start, and this container."""
    kernel = name_space = ""
    with contextlib.suppress(OSError):
        kernel = Path("/proc/sys/kernel/random/boot_id").read_text()
    with contextlib.suppress(OSError):
        name_space = os.readlink("/proc/self/ns/pid")
    return f"{zlib.crc32(f'{socket.gethostname()} {kernel} {name_space}'.encode(errors='replace')):08x}"


def _is_abandoned(left: Path) -> bool:
    inside = left.rglob("*") if left.is_dir() else ()
    newest = max(path.lstat().st_mtime for path in (left, *inside))
    return time.time() - newest > _ABANDONED


def _has_ended(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False  # another user's
    return False


def _is_name(text: str) -> bool:
    """Whether the surrogates in a text stand for the bytes of a file's name."""
    return all(not 0xD800 <= ord(sign) <= 0xDFFF or 0xDC80 <= ord(sign) <= 0xDCFF for sign in text)
