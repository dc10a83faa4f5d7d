"""A temporary folder for this process alone, which goes with it; the next one sweeps up what a killed one left."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import weakref
from functools import lru_cache
from io import BufferedWriter
from pathlib import Path

LOCK = ".held"
"""A file that is locked for as long as its folder's process lives, however that ends."""


class PrivateFolder:
    """Only this user can look into it (mode 700). Removed on `close`, when it is collected, or when Python ends."""

    def __init__(self, prefix: str) -> None:
        """`prefix` begins with "etnet-"."""
        _sweep_once(prefix, os.getpid())
        self.path, self._held = _locked(prefix)
        self._remove = weakref.finalize(self, _remove, self.path, self._held)

    def __enter__(self) -> Path:
        return self.path

    def __exit__(self, *raised: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove it with all that is in it."""
        self._remove()


def sweep(prefix: str) -> None:
    """Remove such folders of this user whose process is gone: killed, it could not do it itself."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            with (folder / LOCK).open("rb+") as held:
                _lock(held.fileno())  # fails while its process lives
                shutil.rmtree(folder, ignore_errors=True)


@lru_cache(maxsize=64)
def _sweep_once(prefix: str, process: int) -> None:
    """Folders are made with every recording that does not fit into memory; one look a process is enough."""
    sweep(prefix)


def _locked(prefix: str) -> tuple[Path, BufferedWriter]:
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix))
        held = (path / LOCK).open("wb")
        _lock(held.fileno())
        if (path / LOCK).exists():
            return path, held
        held.close()  # another process swept it up before it was locked


def _remove(path: Path, held: BufferedWriter) -> None:
    shutil.rmtree(path, ignore_errors=True)
    held.close()


def _lock(descriptor: int) -> None:
    import fcntl

    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
