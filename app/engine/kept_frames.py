"""Frames that earlier runs kept on disk, found by any thread and without torch: they are there while it is imported.

The cache on disk names a run by the network's weights and by its contract, which only torch can tell. So what they
were is noted beside the cache, under everything that they follow from: the weights file, the precision, the device,
the threads, the processor, the version of torch, the source and the measured choices. Where one of them differs
nothing is found, and the engine computes. What it finds out itself, once torch is there, replaces what is shown.
"""

from __future__ import annotations

import hashlib
import logging
import os
import platform
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from app.catalogue.cut import CutRecording
from app.catalogue.models import ModelEntry
from app.catalogue.recording_id import is_of
from app.engine.playbacks import WARM_UP, Library, LoadedPlayback
from app.engine.queue import PendingRequest, RequestQueue
from app.engine.replies import hand_over
from app.engine.requests import FrameRequest, PlaybackKey, Ready
from app.engine.warmth import sparsest_of, warm_up_steps
from etnet.bundled import models
from etnet.errors import EtnetError
from etnet.events.denoise import UNCLEANED
from etnet.events.recording import Recording
from etnet.nets.contract import Contract, contract_of_plain
from etnet.nets.kept_choices import choices_file, processor_name
from etnet.playback.disk_cache import DiskCache, RunCache
from etnet.playback.run_key import code_key, grows, run_key
from etnet.windows import Window, from_window, plan_windows

_log = logging.getLogger(__name__)

MOST_NOTES = 100
MOST_RUNS = 32
"""Runs whose kept frames are looked up at once; the oldest are named again when they are asked for."""


@dataclass(frozen=True, slots=True)
class KeptRanges:
    """What is on disk of a run, as ranges of windows; `nbytes` of memory that it takes."""

    frames: tuple[range, ...]
    states: tuple[range, ...] = ()
    nbytes: int = 0
    is_exact: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class _Named:
    run: RunCache
    contract: Contract
    warm_up: int
    steps: tuple[int, ...]
    """The windows by which its state has seen one more while it warms up (`warm_up_steps`)."""


class KeptFrames:
    """Safe from all threads. Without a cache it finds nothing."""

    def __init__(
        self, library: Library, disk: DiskCache | None, keeps: Callable[[str], bool], device: str, threads: int | None
    ) -> None:
        """`keeps` says of a recording's id whether what is made of it may stay on disk."""
        self._library = library
        self._disk = disk
        self._keeps = keeps
        self._runs_with = (device, threads)
        self._named: dict[PlaybackKey, _Named | None] = {}
        self._lock = Lock()

    def disk_for(self, request: FrameRequest) -> DiskCache | None:
        """Where a request's playback keeps its frames; `None` where nothing of it may stay."""
        is_plain = request.cleaning == UNCLEANED
        return self._disk if self._disk is not None and is_plain and self._keeps(request.recording_id) else None

    def find(self, request: FrameRequest) -> Ready | None:
        """The reply to a request, if its run is named and its frame is kept."""
        named = self._named.get(request.playback)
        if named is None or not request.is_original:
            return None
        array = named.run.frame_array(request.index)
        if array is None:
            return None
        frame = np.ascontiguousarray(array[0, 0], np.float32)
        if not np.isfinite(frame).all():
            return None  # damaged weights: the engine says so
        frame.flags.writeable = False
        num_seen, warm_up = bisect_right(named.steps, request.index), named.warm_up
        return Ready(
            request,
            frame,
            attention=None,
            milliseconds=0.0,
            is_exact=True,
            is_approximate=False,
            is_cold=num_seen < warm_up,
            contract=named.contract,
            num_warm=request.index,
            num_seen=num_seen,
            warm_up=warm_up,
        )

    def ranges(self, request: FrameRequest) -> KeptRanges | None:
        """Which frames are kept; `None` of a run that is not named."""
        named = self._named.get(request.playback)
        return None if named is None else KeptRanges(as_ranges(named.run.frames))

    def is_named(self, request: FrameRequest) -> bool:
        """Whether it is known where a request's frames would be kept, or that they are not."""
        return self._disk is None or request.playback in self._named

    def name(self, request: FrameRequest) -> None:
        """Find out where a request's frames are kept: some ten milliseconds."""
        try:
            named = self._name(request)
        except (EtnetError, OSError, ValueError):
            named = None  # the engine, which opens and plans the same, will say why
        self._keep(request, named, replaces=False)  # it may have learnt better meanwhile

    def learn(self, request: FrameRequest, loaded: LoadedPlayback) -> None:
        """Take over what weights and contract are, now that torch can tell, and note it for later starts."""
        from torch import nn

        disk, recording = self.disk_for(request), loaded.playback.recording
        is_whole = not grows(recording) and not isinstance(recording, CutRecording)
        if disk is None or not is_whole or not isinstance(loaded.playback.model, nn.Module):
            return
        try:
            named = self._learned(disk, request, loaded)
        except (EtnetError, OSError, ValueError):
            named = None
        self._keep(request, named, replaces=True)

    def forget(self, recording_id: str) -> None:
        """Forget where a recording's frames are kept; they stay."""
        with self._lock:
            for key in [key for key in self._named if is_of(key.recording_id, recording_id)]:
                del self._named[key]

    def _name(self, request: FrameRequest) -> _Named | None:
        disk = self.disk_for(request)
        if disk is None:
            return None
        recording = self._library.open(request.recording_id)
        name = self._note_name(request, recording)
        note = None if name is None else _notes(disk).get(name)
        if note is None or grows(recording) or isinstance(recording, CutRecording):
            return None
        windows = from_window(plan_windows(recording, request.policy), request.cold_at)
        try:
            contract = contract_of_plain(note["contract"])
            return self._of(disk, request, recording, windows, str(note["weights"]), contract)
        except (KeyError, TypeError):
            return None

    def _learned(self, disk: DiskCache, request: FrameRequest, loaded: LoadedPlayback) -> _Named | None:
        from torch import nn

        from etnet.nets.fingerprint import weights_sha256
        from etnet.nets.tuning import runs_as_loaded

        model, recording, contract = loaded.playback.model, loaded.playback.recording, loaded.contract
        assert isinstance(model, nn.Module), "learn asks of no other"
        name = self._note_name(request, recording)
        if name is None:
            return None
        weights, size = weights_sha256(model), recording.sensor
        # The next start finds the note by what is measured by now: nothing is noted that it would not come to itself.
        if not hasattr(model, "runtime") or runs_as_loaded(model, size.height, size.width):  # pyright: ignore[reportArgumentType]
            notes, note = _notes(disk), {"weights": weights, "contract": asdict(contract)}
            if notes.get(name) != note:
                kept = dict(list(notes.items())[1 - MOST_NOTES :])
                disk.keep_notes({**kept, name: note})
        return self._of(disk, request, recording, loaded.windows, weights, contract)

    def _of(
        self,
        disk: DiskCache,
        request: FrameRequest,
        recording: Recording,
        windows: Sequence[Window],
        weights: str,
        contract: Contract,
    ) -> _Named:
        run = disk.run(run_key(recording, windows, weights, contract), f"{recording.name} · {len(windows)} windows")
        entry = self._library.model(request.model_id)
        warm_up = entry.warm_up or WARM_UP
        steps = warm_up_steps(windows, warm_up, recording.sensor.num_pixels, sparsest_of(entry.trained_band))
        return _Named(run, contract, warm_up, steps)

    def _keep(self, request: FrameRequest, named: _Named | None, replaces: bool) -> None:
        with self._lock:
            if replaces:
                self._named.pop(request.playback, None)
            self._named.setdefault(request.playback, named)
            while len(self._named) > MOST_RUNS:
                del self._named[next(iter(self._named))]

    def _note_name(self, request: FrameRequest, recording: Recording) -> str | None:
        """Names everything that weights and contract follow from; `None` for a network that no file holds."""
        path = _weights_file(self._library.model(request.model_id))
        if path is None:
            return None
        status, choices = path.stat(), choices_file()
        measured = hashlib.sha256(choices.read_bytes()).hexdigest() if choices.exists() else ""
        about = (
            *(str(path.resolve()), status.st_size, status.st_mtime_ns, request.precision, *self._runs_with),
            *(recording.sensor.height, recording.sensor.width, measured, *_surroundings()),
        )
        return hashlib.sha256(repr(about).encode()).hexdigest()[:32]


def show_kept(kept: KeptFrames, book: RequestQueue, turn: PendingRequest) -> None:
    """Show what an earlier run kept, before the network is there. It stays asked for: the engine's own answer comes."""
    try:
        kept.name(turn.request)
        found = kept.find(turn.request)
    except Exception:
        _log.warning("the frames on disk could not be looked up", exc_info=True)
        return
    if found is not None and book.is_wanted(turn):
        turn.is_shown = True
        hand_over(turn, found)


def as_ranges(indices: Iterable[int]) -> tuple[range, ...]:
    """Indices as half-open ranges, in order."""
    found: list[range] = []
    for index in sorted(indices):
        if found and found[-1].stop == index:
            found[-1] = range(found[-1].start, index + 1)
        else:
            found.append(range(index, index + 1))
    return tuple(found)


def _weights_file(entry: ModelEntry) -> Path | None:
    source = entry.source
    if isinstance(source, str):
        source = next((path for path in models() if path.stem == source), Path(source))
    return source if source.suffix == ".safetensors" and source.is_file() else None


def _notes(disk: DiskCache) -> dict[str, Any]:
    found = disk.notes()
    return {name: note for name, note in found.items() if isinstance(note, dict)}


@lru_cache(maxsize=1)
def _surroundings() -> tuple[object, ...]:
    """What else decides how torch computes here."""
    try:
        torch_version = version("torch")
    except PackageNotFoundError:
        torch_version = ""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    gpus = [path.read_text(errors="replace") for path in sorted(Path("/proc/driver/nvidia/gpus").glob("*/information"))]
    told = {name: value for name, value in sorted(os.environ.items()) if name.startswith(_TELLING)}
    return torch_version, platform.machine(), processor_name(), cores, gpus, repr(told), code_key()


_TELLING = ("OMP_", "MKL_", "ONEDNN_", "DNNL_", "ATEN_", "TORCH_", "KMP_", "CUDA_")
"""Beginnings of the names of environment variables that change how torch computes."""
