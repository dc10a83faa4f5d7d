"""Simulated recordings as files in event_utils' HDF5 layout, which readers of this field open.

Source of the layout: TimoStoff/event_utils, lib/data_formats/event_packagers.py. Flow is stored as that layout's
loaders expect it: a velocity in pixels per second, which times the time since the frame before is the displacement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from jaxtyping import Float32, Int64, UInt8

from etnet.events.events import Events
from etnet.events.formats.hdf5.writing import hdf5_to_write
from etnet.files import replacing
from etnet.simulation.sequence import Sequence

CHUNK = 65_536
"""Events read together."""


@dataclass(frozen=True, eq=False)
class Take:
    """Events and what an ordinary camera saw. `stamps` in µs, ascending; `flow[i]` leads from frame i − 1 to frame i,
    in pixels on the grid of frame i; that of frame 0 is zero."""

    events: Events
    stamps: Int64[np.ndarray, " n"]
    frames: UInt8[np.ndarray, "n h w"]
    flow: Float32[np.ndarray, "n 2 h w"] | None = None


def take_of(sequence: Sequence, with_flow: bool = True) -> Take:
    """A clip with its first frame in front, as 8-bit frames."""
    frames = np.concatenate([sequence.first_frame[None], sequence.frames])
    flow = np.concatenate([np.zeros_like(sequence.flow[:1]), sequence.flow]) if with_flow else None
    return Take(sequence.events, sequence.window_edges, np.rint(frames * 255).astype(np.uint8), flow)


def write_take(path: Path, take: Take, attributes: Mapping[str, str | int | float], gzip_level: int = 4) -> None:
    """Write `take` to `path`, whole or not at all."""
    # The 1.10 format (2016) indexes a picture of one chunk in place: 2.5 kB less for each.
    with replacing(path) as part, hdf5_to_write(part, libver=("v110", "v110")) as file:
        _write_events(file, take.events, gzip_level)
        _write_frames(file, take, gzip_level)
        for key, value in attributes.items():
            file.attrs[key] = value


def _write_events(file: h5py.File, events: Events, gzip_level: int) -> None:
    columns = {
        "xs": events.x.astype(np.int16),
        "ys": events.y.astype(np.int16),
        "ts": events.t * 1e-6,
        "ps": events.p > 0,
    }
    for name, column in columns.items():
        chunks = (min(CHUNK, len(column)),) if len(column) else None
        _compressed(file, f"events/{name}", column, chunks, gzip_level)
    num_positive = int((events.p > 0).sum())
    first, last = (float(events.t[0]), float(events.t[-1])) if len(events) else (0.0, 0.0)
    file.attrs["num_events"] = len(events)
    file.attrs["num_pos"] = num_positive
    file.attrs["num_neg"] = len(events) - num_positive
    file.attrs["t0"], file.attrs["tk"] = first * 1e-6, last * 1e-6
    file.attrs["duration"] = (last - first) * 1e-6
    file.attrs["time_unit"] = "s"  # no part of the layout; without it a quiet scene misleads readers
    file.attrs["sensor_resolution"] = (events.sensor.height, events.sensor.width)


def _write_frames(file: h5py.File, take: Take, gzip_level: int) -> None:
    event_index = np.maximum(np.searchsorted(take.events.t, take.stamps) - 1, 0)
    for i, (stamp, frame) in enumerate(zip(take.stamps, take.frames, strict=True)):
        image = _compressed(file, f"images/image{i:09d}", frame, frame.shape, gzip_level)
        image.attrs["size"] = frame.shape
        image.attrs["timestamp"] = int(stamp) * 1e-6
        image.attrs["type"] = "greyscale"
        image.attrs["event_idx"] = int(event_index[i])
    file.attrs["num_imgs"] = len(take.frames)
    file.attrs["num_flow"] = 0 if take.flow is None else len(take.flow)
    if take.flow is None:
        return
    seconds = np.diff(take.stamps, prepend=take.stamps[0] - 1) * 1e-6
    for i, (stamp, flow) in enumerate(zip(take.stamps, take.flow, strict=True)):
        velocity = (flow / seconds[i]).astype(np.float32)
        data = _compressed(file, f"flow/flow{i:09d}", velocity, velocity.shape, gzip_level)
        data.attrs["size"] = velocity.shape
        data.attrs["timestamp"] = int(stamp) * 1e-6
        data.attrs["event_idx"] = int(event_index[i])
        data.attrs["unit"] = "px/s"


def _compressed(
    file: h5py.File, name: str, data: np.ndarray, chunks: tuple[int, ...] | None, gzip_level: int
) -> h5py.Dataset:
    """A dataset with the filters that every HDF5 library has; one without elements takes none."""
    if chunks is None:
        return file.create_dataset(name, data=data)
    return file.create_dataset(
        name, data=data, chunks=chunks, compression="gzip", compression_opts=gzip_level, shuffle=True
    )
