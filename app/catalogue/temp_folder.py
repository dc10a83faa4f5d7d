"""A temporary folder for this process alone, which goes with it; the next one sweeps up what a killed one left."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
import weakref
from pathlib import Path

LOCK = ".held"
"""A file that is locked for as long as its folder's process lives, however that ends."""


class PrivateFolder:
    """Only this user can look into it (mode 700). Removed on `close`, or when Python ends."""

    def __init__(self, prefix: str) -> None:
        sweep(prefix)
        self.path = Path(tempfile.mkdtemp(prefix=prefix))
        self._held = (self.path / LOCK).open("wb")
        _lock(self._held.fileno())
        self._remove = weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)

    def close(self) -> None:
        """Remove it with all that is in it."""
        self._remove()
        self._held.close()


def sweep(prefix: str) -> None:
    """Remove such folders of this user whose process is gone: killed, it could not do it itself."""
    for folder in Path(tempfile.gettempdir()).glob(f"{prefix}*"):
        with contextlib.suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            with (folder / LOCK).open("rb+") as held:
                _lock(held.fileno())  # fails while its process lives
                shutil.rmtree(folder, ignore_errors=True)


def _lock(descriptor: int) -> None:
    import fcntl

    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
