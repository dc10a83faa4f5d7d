"""A simulated recording that grows on disk, in event_utils' HDF5 layout, one frame and its events at a time."""

from __future__ import annotations

from collections.abc import Mapping

import h5py
import numpy as np
from jaxtyping import Float32, Shaped

from etnet.events.events import Events, Sensor

CHUNK = 65_536
"""Events stored together."""


class RecordingSink:
    """Columns that grow on disk. Stamps never run back: what came after a frame's stamp is stamped with or after it."""

    def __init__(self, file: h5py.File, sensor: Sensor) -> None:
        self.num_events, self.num_frames, self.last = 0, 0, 0
        self._file, self._sensor = file, sensor
        self.num_flows, self._num_positive, self._first = 0, 0, 0
        kinds = {"xs": np.int16, "ys": np.int16, "ts": np.float64, "ps": np.bool_}
        self._columns = {
            name: file.create_dataset(
                f"events/{name}", (0,), kind, maxshape=(None,), chunks=(CHUNK,), compression="gzip", shuffle=True
            )
            for name, kind in kinds.items()
        }

    def append(self, events: Events) -> None:
        """Add the events of one frame, in order."""
        if len(events) == 0:
            return
        start, stop = self.num_events, self.num_events + len(events)
        for name, column in (
            ("xs", events.x.astype(np.int16)),
            ("ys", events.y.astype(np.int16)),
            ("ts", events.t * 1e-6),
            ("ps", events.p > 0),
        ):
            held = self._columns[name]
            if stop > len(held):
                # By whole chunks: to resize a dataset costs more than to write a frame's events.
                held.resize((-(-stop // CHUNK) * CHUNK,))
            held[start:stop] = column
        self._first = int(events.t[0]) if start == 0 else self._first
        self.last, self.num_events = int(events.t[-1]), stop
        self._num_positive += int((events.p > 0).sum())

    def add_frame(self, t: float, picture: Shaped[np.ndarray, "h w *c"]) -> None:
        """Add a frame at `t` (µs), in its own depth; a colour one is blue, green, red."""
        image = self._compressed(f"images/image{self.num_frames:09d}", picture)
        image.attrs["size"] = picture.shape
        image.attrs["timestamp"] = np.floor(t) * 1e-6
        image.attrs["type"] = "greyscale" if picture.ndim == 2 else "color_bgr"
        image.attrs["event_idx"] = max(self.num_events - 1, 0)
        self.num_frames += 1

    def add_flow(self, t: float, flow: Float32[np.ndarray, "2 h w"], seconds: float) -> None:
        """Add the flow that leads to the newest frame; the layout wants a velocity, pixels a second."""
        data = self._compressed(f"flow/flow{self.num_frames - 1:09d}", (flow / seconds).astype(np.float32))
        data.attrs["size"], data.attrs["timestamp"] = flow.shape, np.floor(t) * 1e-6
        data.attrs["event_idx"], data.attrs["unit"] = max(self.num_events - 1, 0), "px/s"
        self.num_flows += 1

    def finish(self, attributes: Mapping[str, str | int | float]) -> None:
        """Write what readers of this layout look for first, and how it was made."""
        for column in self._columns.values():
            column.resize((self.num_events,))
        found = self._file.attrs
        found["num_events"] = self.num_events
        found["num_pos"], found["num_neg"] = self._num_positive, self.num_events - self._num_positive
        found["t0"], found["tk"] = self._first * 1e-6, self.last * 1e-6
        found["duration"] = (self.last - self._first) * 1e-6
        found["time_unit"] = "s"  # no part of the layout; without it a quiet scene misleads readers
        found["sensor_resolution"] = (self._sensor.height, self._sensor.width)
        found["num_imgs"], found["num_flow"] = self.num_frames, self.num_flows
        for name, value in attributes.items():
            found[name] = value

    def _compressed(self, name: str, data: np.ndarray) -> h5py.Dataset:
        return self._file.create_dataset(
            name, data=data, chunks=data.shape, compression="gzip", compression_opts=4, shuffle=True
        )
