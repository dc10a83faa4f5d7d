"""Time indices of large files, kept in the user's cache folder. One that is wrong in any way is made again."""

from __future__ import annotations

import contextlib
import hashlib
import io
import time
from pathlib import Path

import numpy as np
from jaxtyping import Int64

from etnet.errors import EtnetError
from etnet.files import UNFINISHED, cache_folder, write_atomically

BESIDE = ".etnet-indices"
"""A folder of this name beside a file takes the file's indices: they go with the folder that they lie in."""
MAX_FILES = 256
"""Indices kept; beyond it the ones that were written first go. The largest is a few megabytes."""

_SAMPLES, _SAMPLE_BYTES = 16, 1 << 16
_DIGEST_BYTES = 32
_ABANDONED = 86_400
"""Seconds after which an unfinished file is that of a process that was stopped."""

Arrays = dict[str, Int64[np.ndarray, "..."]]


def index_folder() -> Path:
    """`indices` in ETNET_CACHE, or `etnet/indices` in the user's cache folder."""
    return cache_folder() / "indices"


def index_path(file: Path, what: str) -> Path:
    """Where the index of a file lies: named by its size, its time of change, samples of its content, and `what`.

    The content is hashed at 16 places of 64 KB, first and last bytes among them: all of 10 GB would take as long as
    making the index.
    """
    status = file.stat()
    digest = hashlib.sha256(f"{what}|{status.st_size}|{status.st_mtime_ns}".encode())
    with file.open("rb") as stream:
        for place in np.linspace(0, max(0, status.st_size - _SAMPLE_BYTES), _SAMPLES).astype(np.int64):
            stream.seek(int(place))
            digest.update(stream.read(_SAMPLE_BYTES))
    beside = file.parent / BESIDE
    folder = beside if beside.is_dir() else index_folder()
    return folder / f"{digest.hexdigest()[:32]}.index"


def load_index(path: Path) -> Arrays | None:
    """The arrays that were kept, or None where there are none or a single byte of them is not what it was."""
    try:
        content = path.read_bytes()
        payload = content[_DIGEST_BYTES:]
        if hashlib.sha256(payload).digest() != content[:_DIGEST_BYTES]:
            return None
        with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError):
        return None


def save_index(path: Path, arrays: Arrays) -> None:
    """Keep them. The file appears whole, even if others write it; where no file can be written nothing is kept."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # pyright: ignore[reportArgumentType]
    with contextlib.suppress(OSError, EtnetError):
        path.parent.mkdir(parents=True, exist_ok=True)
        content = hashlib.sha256(buffer.getvalue()).digest() + buffer.getvalue()
        write_atomically(path, content, flushes=False)
        _prune(path.parent)


def _prune(folder: Path) -> None:
    kept = sorted(folder.glob("*.index"), key=lambda each: each.stat().st_mtime)
    forgotten = [each for each in folder.glob(f"*{UNFINISHED}") if time.time() - each.stat().st_mtime > _ABANDONED]
    for old in (*kept[:-MAX_FILES], *forgotten):
        old.unlink(missing_ok=True)
