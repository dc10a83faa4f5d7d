"""Write what comes live as event_utils HDF5, so that a kill leaves all up to the last flush.

Layout: TimoStoff/event_utils, lib/data_formats/event_packagers.py; triggers beside it, as t, channel and edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from etnet.events.events import Events, Sensor
from etnet.events.formats.hdf5.journal import CommittedFile
from etnet.events.formats.hdf5.writing import bound_metadata
from etnet.events.triggers import Triggers
from etnet.live.source import CameraFrame, Setting, as_json

CHUNK = 32_768
"""Events stored together."""


class Hdf5Writer:
    """Columns that grow. Each `flush` is a commit."""

    def __init__(self, path: Path, sensor: Sensor, source: str, settings: Sequence[Setting] = ()) -> None:
        """`settings`: the source's as they are now; the file says them as JSON."""
        self.num_events, self._num_on, self._num_frames = 0, 0, 0
        self._first, self._last = 0, 0
        self._held: list[Events] = []
        self._raw = CommittedFile(path)
        self._file = h5py.File(self._raw, "w", libver="earliest")
        bound_metadata(self._file)
        options = {"maxshape": (None,), "chunks": (CHUNK,), "compression": "lzf", "shuffle": True}
        for name, kind in (("xs", "i2"), ("ys", "i2"), ("ts", "f8"), ("ps", "?")):
            self._file.create_dataset(f"events/{name}", (0,), kind, **options)
        for name, kind in (("t", "i8"), ("channel", "i2"), ("edge", "i1")):
            self._file.create_dataset(f"triggers/{name}", (0,), kind, maxshape=(None,), chunks=(1024,))
        self._file.attrs["sensor_resolution"] = np.array([sensor.height, sensor.width])
        # No part of the layout; without it a reader has to judge the unit, and a quiet scene misleads it.
        self._file.attrs["time_unit"] = "s"
        self._file.attrs["source"] = f"live from {source}"
        if settings:
            self._file.attrs["settings"] = as_json(settings)
        self.flush()

    def add_events(self, events: Events) -> None:
        """More events, in order."""
        if len(events):
            self._held.append(events)
            if sum(map(len, self._held)) >= 16 * CHUNK:
                self._store()

    def add_frame(self, frame: CameraFrame, num_before: int) -> None:
        """One picture; `num_before` events are earlier."""
        image = self._file.create_dataset(f"images/image{self._num_frames:09d}", data=frame.pixels, compression="lzf")
        image.attrs["size"], image.attrs["type"] = np.array(frame.pixels.shape), "greyscale"
        image.attrs["timestamp"] = frame.stamp / 1e6
        image.attrs["event_idx"] = max(0, num_before - 1)
        self._num_frames += 1

    def add_triggers(self, triggers: Triggers) -> None:
        """More triggers, in order."""
        for name, column in (("t", triggers.stamps), ("channel", triggers.channels), ("edge", triggers.edges)):
            self._append(f"triggers/{name}", column)

    def flush(self) -> None:
        """What was given so far is in the file from here on."""
        self._store()
        attributes = self._file.attrs
        attributes["num_events"], attributes["num_imgs"], attributes["num_flow"] = self.num_events, self._num_frames, 0
        attributes["num_pos"], attributes["num_neg"] = self._num_on, self.num_events - self._num_on
        attributes["t0"], attributes["tk"] = self._first / 1e6, self._last / 1e6
        attributes["duration"] = (self._last - self._first) / 1e6
        self._file.flush()
        self._raw.commit()

    def close(self) -> None:
        """Finish the file."""
        try:
            self.flush()
        finally:
            # HDF5 first, whatever the disk said: it goes on calling its file until it is closed itself.
            self._file.close()
            self._raw.close()

    def _store(self) -> None:
        if not self._held:
            return
        x, y, t, p = (np.concatenate([getattr(part, name) for part in self._held]) for name in "xytp")
        self._held.clear()
        if self.num_events == 0:
            self._first = int(t[0])
        self._last = int(t[-1])
        self.num_events += len(t)
        self._num_on += int(np.count_nonzero(p > 0))
        for name, column in (("xs", x.astype("i2")), ("ys", y.astype("i2")), ("ts", t / 1e6), ("ps", p > 0)):
            self._append(f"events/{name}", column)

    def _append(self, name: str, column: np.ndarray) -> None:
        table = self._file[name]
        assert isinstance(table, h5py.Dataset)
        start = len(table)
        table.resize((start + len(column),))
        table[start:] = column
