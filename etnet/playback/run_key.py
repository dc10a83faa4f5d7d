"""What a run's frames depend on, as one name: events, weights, windows and contract."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from torch import nn

from etnet.events.recording import Recording
from etnet.nets.base import Reconstructor
from etnet.nets.fingerprint import weights_sha256
from etnet.nets.runtime import Contract, contract_of
from etnet.playback.disk_cache import DiskCache, RunCache
from etnet.windows import Window

_SAMPLES, _SAMPLE_EVENTS = 16, 1 << 14
_MOST_WINDOWS = 64
"""Looked at of a plan that makes its windows from a rule; of one that lists them, all."""


def run_cache(
    cache: DiskCache, model: Reconstructor, recording: Recording, windows: Sequence[Window]
) -> RunCache | None:
    """The part of `cache` for what `model` makes of these windows.

    `None` where no name would be safe: a network whose weights cannot be read, a recording that still grows.
    """
    if not isinstance(model, nn.Module) or recording.growth is not None or recording.latest is not None:
        return None
    return cache.run(
        run_key(model, recording, windows, contract_of(model)),
        f"{recording.name} · {model.name} · {len(windows)} windows",
    )


def run_key(model: nn.Module, recording: Recording, windows: Sequence[Window], contract: Contract) -> str:
    """A hash of everything that decides the bits of a run's frames."""
    parts = (recording_key(recording), weights_sha256(model), windows_key(windows), repr(contract))
    return hashlib.sha256("|".join(parts).encode()).hexdigest()[:32]


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
