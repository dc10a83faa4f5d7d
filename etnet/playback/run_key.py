"""What a run's frames depend on, as one name: events, weights, windows and contract."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from etnet.events.recording import Recording
from etnet.nets.contract import Contract
from etnet.playback.disk_cache import DiskCache, RunCache
from etnet.windows import Window

if TYPE_CHECKING:
    from etnet.nets.base import Reconstructor

_SAMPLES, _SAMPLE_EVENTS = 16, 1 << 14
_MOST_WINDOWS = 64
"""Looked at of a plan that makes its windows from a rule; of one that lists them, all."""


def run_cache(
    cache: DiskCache, model: Reconstructor, recording: Recording, windows: Sequence[Window]
) -> RunCache | None:
    """The part of `cache` for what `model` makes of these windows.

    `None` where no name would be safe: a network whose weights cannot be read, a recording that still grows.
    """
    from torch import nn

    from etnet.nets.fingerprint import weights_sha256
    from etnet.nets.runtime import contract_of

    if not isinstance(model, nn.Module) or grows(recording):
        return None
    key = run_key(recording, windows, weights_sha256(model), contract_of(model))
    return cache.run(key, f"{recording.name} · {model.name} · {len(windows)} windows")


def grows(recording: Recording) -> bool:
    """Whether a recording becomes longer: what is made of it so far has no name yet."""
    return recording.growth is not None or recording.latest is not None


def run_key(recording: Recording, windows: Sequence[Window], weights: str, contract: Contract) -> str:
    """A hash of everything that decides the bits of a run's frames; `weights` is their `weights_sha256`."""
    parts = (recording_key(recording), weights, windows_key(windows), repr(contract), code_key())
    return hashlib.sha256("|".join(parts).encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def code_key() -> str:
    """A hash of the source that makes voxels and frames: another release, or an edit, may give other bits."""
    package, digest = Path(__file__).resolve().parents[1], hashlib.sha256()
    for path in (*sorted((package / "nets").glob("*.py")), package / "voxel.py", package / "reconstruction.py"):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def recording_key(recording: Recording) -> str:
    """A hash of size, span and 16 samples of the events, and of the file's size and time of change.

    Not of all events: 10 GB would take minutes. `events_sha256` of the session files is the one that reads them all.
    """
    about = f"{recording.sensor.width} {recording.sensor.height} {recording.num_events} {recording.span}"
    digest = hashlib.sha256(about.encode())
    if recording.path is not None and recording.path.exists():
        status = recording.path.stat()
        digest.update(f"{status.st_size} {status.st_mtime_ns}".encode())
    last = max(0, recording.num_events - _SAMPLE_EVENTS)
    for start in np.unique(np.linspace(0, last, _SAMPLES).astype(np.int64)):
        events = recording.read(int(start), min(int(start) + _SAMPLE_EVENTS, recording.num_events))
        for column in (events.x, events.y, events.t, events.p):
            digest.update(np.ascontiguousarray(column).tobytes())
    return digest.hexdigest()


def windows_key(windows: Sequence[Window]) -> str:
    """A hash of a plan's length and windows."""
    length = len(windows)
    chosen = range(length)
    if not isinstance(windows, tuple | list) and length > _MOST_WINDOWS:
        chosen = sorted({*range(4), *(int(i) for i in np.linspace(0, length - 1, _MOST_WINDOWS))})
    content = "|".join(repr(windows[i]) for i in chosen)
    return hashlib.sha256(f"{length}|{content}".encode()).hexdigest()
