"""Frames and sparse states of earlier runs, on disk: within a budget of bytes, and bit for bit or not at all."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import shutil
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from queue import Full, Queue
from threading import Lock, Thread
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

import numpy as np
from jaxtyping import Float
from safetensors import SafetensorError

from etnet.errors import EtnetError
from etnet.files import UNFINISHED, cache_folder, write_atomically

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.nets.base import State

DEFAULT_BUDGET = 1 << 30
STATE_SPACING = 16
"""Windows from one kept state to the next: a seek after a restart replays fewer than these."""
_WAITING = 8
"""Tensors that may wait to be written; beyond it they are not kept, and nothing waits for the disk."""
_ROOM = 0.9
"""Of the budget, that is left full when the least recently used files have gone."""
_ABANDONED = 3600
"""Seconds after which an unfinished file is that of a process that was stopped."""
_CHECKSUM_BYTES = 4
_FRAME, _STATE = ".frame", ".state"
_NOTES = "notes.json"

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class KeptRun:
    """What the cache holds of one recording, network, windows and contract."""

    folder: Path
    title: str
    """In words: the recording and the network."""
    num_frames: int
    num_states: int
    nbytes: int
    last_used: float
    """Seconds since 1970."""


class DiskCache:
    """A folder of frames and states that every process of the user shares; the least recently used go first.

    Written by one thread in the background. A folder that cannot be written keeps nothing and breaks nothing.
    """

    def __init__(self, folder: Path | None = None, budget_bytes: int = DEFAULT_BUDGET) -> None:
        self.folder = cache_folder() / "frames" if folder is None else folder
        self.budget_bytes = budget_bytes
        self._jobs: Queue[Callable[[], int]] = Queue(_WAITING)
        self._writer: Thread | None = None
        self._lock = Lock()
        self._nbytes: int | None = None
        self._runs: WeakValueDictionary[str, RunCache] = WeakValueDictionary()

    def run(self, key: str, title: str) -> RunCache:
        """The part of the cache that holds one run; `key` names all that its frames depend on.

        As long as somebody holds it, it is one and the same: what one of them writes the other finds.
        """
        with self._lock:
            run = self._runs.get(key)
            if run is None:
                run = self._runs[key] = RunCache(self, self.folder / key, title)
            return run

    def runs(self) -> tuple[KeptRun, ...]:
        """What is held, the most recently used first."""
        found = (_kept_run(folder) for folder in _folders(self.folder))
        return tuple(sorted((run for run in found if run is not None), key=lambda run: -run.last_used))

    def clear(self, run: KeptRun | None = None) -> None:
        """Forget one run, or everything."""
        for folder in _folders(self.folder) if run is None else (run.folder,):
            shutil.rmtree(folder, ignore_errors=True)
        if run is None:
            (self.folder / _NOTES).unlink(missing_ok=True)
        self._nbytes = None

    def notes(self) -> dict[str, object]:
        """What was noted beside the runs (`keep_notes`)."""
        try:
            content = json.loads((self.folder / _NOTES).read_bytes())
        except (OSError, ValueError):
            return {}
        return content if isinstance(content, dict) else {}

    def keep_notes(self, notes: dict[str, object]) -> None:
        """Replace what is noted beside the runs; they are no part of the budget."""
        with contextlib.suppress(OSError, EtnetError):
            self.folder.mkdir(parents=True, exist_ok=True)
            write_atomically(self.folder / _NOTES, json.dumps(notes).encode(), flushes=False)

    def flush(self) -> None:
        """Wait until everything that was given is written."""
        self._jobs.join()

    def later(self, job: Callable[[], int]) -> None:
        """Let the writer do `job`, which gives the bytes that it wrote; left out if too much waits already."""
        with self._lock:
            if self._writer is None:
                self._writer = Thread(target=self._write, name="disk cache", daemon=True)
                self._writer.start()
        with contextlib.suppress(Full):
            self._jobs.put_nowait(job)

    def _write(self) -> None:
        while True:
            job = self._jobs.get()
            try:
                self._account(job())
            except Exception:  # a full disk, or a folder that was removed meanwhile: the next one may be written
                _log.info("a frame or state is not kept", exc_info=True)
            finally:
                self._jobs.task_done()

    def _account(self, written: int) -> None:
        """Keep the sum of bytes, and the budget. Other processes write too: what matters is counted again."""
        self._nbytes = (
            sum(size for _, size, _ in _files(self.folder)) if self._nbytes is None else self._nbytes + written
        )
        if self._nbytes <= self.budget_bytes:
            return
        files = sorted(_files(self.folder), key=lambda file: file[2])
        self._nbytes = sum(size for _, size, _ in files)
        for path, size, _ in files:
            if self._nbytes <= self.budget_bytes * _ROOM:
                break
            path.unlink(missing_ok=True)
            self._nbytes -= size
            with self._lock:
                run = self._runs.get(path.parent.name)
            if run is not None:
                run.note_gone(path.name)
        for folder in _folders(self.folder):
            if not any(folder.glob(f"*{_FRAME}")) and not any(folder.glob(f"*{_STATE}")):
                shutil.rmtree(folder, ignore_errors=True)


class RunCache:
    """Frames and states of one run by the index of their window. A damaged file is one that is not there."""

    def __init__(self, cache: DiskCache, folder: Path, title: str) -> None:
        self._cache = cache
        self._folder = folder
        self._title = title
        names = [path.name for path in folder.glob("*.*")] if folder.is_dir() else []
        self._frames = {int(name[: -len(_FRAME)]) for name in names if name.endswith(_FRAME)}
        self._states = {int(name[: -len(_STATE)]) for name in names if name.endswith(_STATE)}

    @property
    def frames(self) -> frozenset[int]:
        """Windows whose frames are held."""
        return frozenset(self._frames)

    @property
    def states(self) -> frozenset[int]:
        """Windows after which states are held."""
        return frozenset(self._states)

    def frame(self, index: int) -> Tensor | None:
        """A frame, bit for bit as it was given; `None` if it is not there."""
        if index not in self._frames:
            return None
        tensors = _read(self._folder / f"{index}{_FRAME}")
        if tensors is None:
            self._frames.discard(index)
            return None
        return tensors[0]

    def frame_array(self, index: int) -> Float[np.ndarray, "1 1 h w"] | None:
        """A frame as `frame` gives it, without torch; `None` if it is not there, or is of a type numpy lacks."""
        from safetensors.numpy import load

        if index not in self._frames:
            return None
        payload = _payload(self._folder / f"{index}{_FRAME}")
        if payload is None:
            self._frames.discard(index)
        try:
            arrays = [] if payload is None else list(load(payload).values())
        except (SafetensorError, ValueError, KeyError, TypeError):
            arrays = []
        return arrays[0] if len(arrays) == 1 and arrays[0].dtype in (np.float32, np.float16) else None

    def state(self, index: int) -> State | None:
        """A state, bit for bit and in the memory format in which it was given; `None` if it is not there."""
        if index not in self._states:
            return None
        from etnet.nets.base import State

        tensors = _read(self._folder / f"{index}{_STATE}")
        if tensors is None:
            self._states.discard(index)
            return None
        return State(tensors)

    def put_frame(self, index: int, frame: Tensor) -> None:
        """Keep a frame; it is written later."""
        if index not in self._frames:
            self._later(self._frames, index, _FRAME, (frame,))

    def put_state(self, index: int, state: State) -> None:
        """Keep a state if it is one of every `STATE_SPACING`; it is written later."""
        if index % STATE_SPACING == STATE_SPACING - 1 and index not in self._states:
            self._later(self._states, index, _STATE, state.tensors)

    def note_gone(self, name: str) -> None:
        """One of its files has made room for others: what was in it is not held any more."""
        for held, suffix in ((self._frames, _FRAME), (self._states, _STATE)):
            if name.endswith(suffix):
                held.discard(int(name[: -len(suffix)]))

    def _later(self, held: set[int], index: int, suffix: str, tensors: tuple[Tensor, ...]) -> None:
        def write() -> int:
            path = self._folder / f"{index}{suffix}"
            if not (self._folder / "run.json").exists():
                self._folder.mkdir(parents=True, exist_ok=True)
                title = json.dumps({"title": self._title}).encode()
                write_atomically(self._folder / "run.json", title, flushes=False)
            content = _packed(tensors)
            if len(content) > self._cache.budget_bytes // 4:
                return 0
            write_atomically(path, content, flushes=False)
            held.add(index)
            return len(content)

        self._cache.later(write)


def _packed(tensors: tuple[Tensor, ...]) -> bytes:
    """Tensors as safetensors behind a checksum; a name says "l" where the channels lie last in memory."""
    from safetensors.torch import save

    named = {
        f"{number}{'l' if _is_channels_last(tensor) else ''}": tensor.detach().cpu().contiguous()
        for number, tensor in enumerate(tensors)
    }
    content = save(named)
    return zlib.crc32(content).to_bytes(_CHECKSUM_BYTES, "little") + content


def _payload(path: Path) -> bytes | None:
    """What a file holds behind its checksum; a damaged one is removed."""
    try:
        content = path.read_bytes()
        os.utime(path)
    except OSError:
        return None
    checksum, payload = content[:_CHECKSUM_BYTES], content[_CHECKSUM_BYTES:]
    if zlib.crc32(payload) != int.from_bytes(checksum, "little"):
        path.unlink(missing_ok=True)
        return None
    return payload


def _read(path: Path) -> tuple[Tensor, ...] | None:
    import torch
    from safetensors.torch import load

    payload = _payload(path)
    try:
        tensors = [] if payload is None else sorted(load(payload).items(), key=lambda item: int(item[0].rstrip("l")))
    except (SafetensorError, ValueError):
        return None
    found = (
        tensor.contiguous(memory_format=torch.channels_last) if name.endswith("l") else tensor
        for name, tensor in tensors
    )
    return tuple(found) or None


def _is_channels_last(tensor: Tensor) -> bool:
    import torch

    return tensor.ndim == 4 and not tensor.is_contiguous() and tensor.is_contiguous(memory_format=torch.channels_last)


def _folders(folder: Path) -> tuple[Path, ...]:
    return tuple(each for each in folder.iterdir() if each.is_dir()) if folder.is_dir() else ()


def _files(folder: Path) -> Iterator[tuple[Path, int, float]]:
    """Path, bytes and time of last use of every file; what another process left unfinished long ago is removed."""
    for run in _folders(folder):
        for path in run.glob("*"):
            with contextlib.suppress(OSError):
                status = path.stat()
                if f".{UNFINISHED}" in path.name and time.time() - status.st_mtime > _ABANDONED:
                    path.unlink(missing_ok=True)
                elif path.name != "run.json":
                    yield path, status.st_size, status.st_mtime


def _kept_run(folder: Path) -> KeptRun | None:
    try:
        title = str(json.loads((folder / "run.json").read_bytes())["title"])
        files = [(path.suffix, path.stat()) for path in folder.glob("*") if path.suffix in (_FRAME, _STATE)]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return KeptRun(
        folder,
        title,
        sum(suffix == _FRAME for suffix, _ in files),
        sum(suffix == _STATE for suffix, _ in files),
        sum(status.st_size for _, status in files),
        max((status.st_mtime for _, status in files), default=0.0),
    )
