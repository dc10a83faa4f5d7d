"""The stamps of every 65,536th event of a long file that is read by slice, gathered in the background and kept."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from threading import Event, Lock, Thread

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.formats.base import Request, contained
from etnet.events.index_store import index_path, load_index, save_index
from etnet.events.recording import INDEX_BLOCK

_DECODING = 1
"""Raised when stamps are turned into µs in another way: what was kept before is then made again."""

_PAUSE = 0.001
"""Seconds between two looks, in which those who read events get the lock."""


class StampIndex:
    """Finds the block of a moment once it is ready; until then, and where the file is damaged, it knows nothing."""

    def __init__(
        self, request: Request, num_events: int, read_stamps: Callable[[int, int], np.ndarray], lock: Lock
    ) -> None:
        self._num_events = num_events
        self._num_blocks = -(-num_events // INDEX_BLOCK)
        self._read_stamps = read_stamps
        self._lock = lock
        self._name = request.name
        self._stopped = Event()
        self._stamps: Int64[np.ndarray, " blocks"] | None = None
        self._path = _path_of(request, num_events)
        kept = None if self._path is None else load_index(self._path)
        if kept is not None and self._holds(kept.get("stamps", np.empty(0))):
            self._stamps = kept["stamps"]
            return
        self._thread = Thread(target=self._gather, name=f"index of {request.name}", daemon=True)
        self._thread.start()

    @property
    def is_ready(self) -> bool:
        """Whether the index is there."""
        return self._stamps is not None

    def bracket(self, t: int) -> tuple[int, int] | None:
        """Events among which the first one at or after `t` lies, µs."""
        if self._stamps is None:
            return None
        block = max(0, int(np.searchsorted(self._stamps, t)) - 1)
        return block * INDEX_BLOCK, min((block + 1) * INDEX_BLOCK, self._num_events)

    def _holds(self, stamps: Int64[np.ndarray, " blocks"]) -> bool:
        """Whether it was made of these stamps, in the unit that they are judged to have now."""
        if stamps.shape != (self._num_blocks,):
            return False
        places = (0, (self._num_blocks - 1) * INDEX_BLOCK)
        return all(int(self._read_stamps(place, place + 1)[0]) == stamps[place // INDEX_BLOCK] for place in places)

    def stop(self) -> None:
        """Give up gathering; the file may be closed afterwards."""
        self._stopped.set()
        if self._stamps is None:
            self._thread.join()

    def _gather(self) -> None:
        stamps = np.empty(self._num_blocks, np.int64)
        try:
            for block in range(self._num_blocks):
                if self._stopped.is_set():
                    return
                place = block * INDEX_BLOCK
                with self._lock, contained(self._name, f"the stamp of event {place}"):
                    stamps[block] = self._read_stamps(place, place + 1)[0]
                time.sleep(_PAUSE)
        except RecordingError:
            # Whoever reads there is told; a search without the index goes on elsewhere.
            return
        if bool((np.diff(stamps) >= 0).all()):
            if self._path is not None:
                save_index(self._path, {"stamps": stamps})
            self._stamps = stamps


def _path_of(request: Request, num_events: int) -> Path | None:
    """Where the index is kept. A folder has no content of its own to know it by: its index is made each time."""
    if request.path.is_dir():
        return None
    # A stated unit changes the stamps.
    return index_path(request.path, f"stamps of {num_events}, unit {request.assume.time_unit}, {_DECODING}")
