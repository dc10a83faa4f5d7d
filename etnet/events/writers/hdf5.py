"""The HDF5 layouts that are written: event_utils, DSEC and MVSEC."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import hdf5plugin
import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.hdf5.writing import WrittenFile, hdf5_to_write
from etnet.events.recording import Remark
from etnet.events.writers.part import Part, without_colour, without_flow, without_frames

_CHUNK = 32_768


def write_event_utils(part: Part, path: Path) -> tuple[Remark, ...]:
    """TimoStoff/event_utils, lib/data_formats/event_packagers.py: what ET-Net and E2VID+ are trained with."""
    sensor, first, last = part.recording.sensor, part.first_stamp(), part.last_stamp()
    if max(sensor.width, sensor.height) > 1 << 15:
        raise RecordingError(f"{path.name}: a sensor of {sensor} does not fit event_utils' 16 bits; write DSEC or npz")
    num_on, place = 0, 0
    with hdf5_to_write(path) as file:
        shape, options = (part.num_events,), {"chunks": (min(_CHUNK, part.num_events),), "compression": "gzip"}
        xs, ys = (file.create_dataset(f"events/{axis}", shape, "i2", **options) for axis in ("xs", "ys"))
        ts = file.create_dataset("events/ts", shape, "f8", **options)
        ps = file.create_dataset("events/ps", shape, "?", **options)
        for events in part.blocks():
            span = slice(place, place + len(events))
            xs[span], ys[span], ts[span], ps[span] = events.x, events.y, events.t / 1e6, events.p > 0
            num_on += int(np.count_nonzero(events.p > 0))
            place = span.stop
            file.check()
        file.attrs["num_events"], file.attrs["num_pos"] = part.num_events, num_on
        file.attrs["num_neg"], file.attrs["duration"] = part.num_events - num_on, (last - first) / 1e6
        # No part of the layout; without it a reader has to judge the unit, and a quiet scene misleads it.
        file.attrs["time_unit"] = "s"
        file.attrs["t0"], file.attrs["tk"] = first / 1e6, last / 1e6
        file.attrs["num_imgs"], file.attrs["num_flow"] = _write_images(part, file), _write_flow(part, file)
        _write_the_rest(part, file)
    return ()


def write_dsec(part: Part, path: Path) -> tuple[Remark, ...]:
    """dsec.ifi.uzh.ch/data-format: t from 0 with t_offset, and ms_to_idx."""
    first, last = part.first_stamp(), part.last_stamp()
    if last - first >= 2**32:
        raise RecordingError(f"{path.name}: {(last - first) // 10**6} s are too long for DSEC's 32-bit stamps; cut it")
    place = 0
    with hdf5_to_write(path) as file:
        options = dict(hdf5plugin.Blosc(cname="zstd", clevel=5, shuffle=hdf5plugin.Blosc.SHUFFLE))
        options["chunks"] = (min(_CHUNK, part.num_events),)
        kinds = {"x": "u2", "y": "u2", "t": "u4", "p": "u1"}
        table = {
            axis: file.create_dataset(f"events/{axis}", (part.num_events,), k, **options) for axis, k in kinds.items()
        }
        for events in part.blocks():
            span = slice(place, place + len(events))
            table["x"][span], table["y"][span] = events.x, events.y
            table["t"][span], table["p"][span] = events.t - first, events.p > 0
            place = span.stop
            file.check()
        num_ms = (last - first) // 1000 + 1
        indices = [part.recording.index_at(first + 1000 * ms) - part.start for ms in range(num_ms)]
        # Events before `start` may carry the first stamp too.
        file["ms_to_idx"] = np.maximum(np.array(indices, np.int64), 0).astype(np.uint64)
        file["t_offset"] = np.int64(first)
        _write_the_rest(part, file)
    return without_frames(part, "DSEC keeps its pictures in files of their own")


def write_mvsec(part: Part, path: Path) -> tuple[Remark, ...]:
    """daniilidis-group.github.io/mvsec/download: rows of x, y, t in s, p = ±1, and the pictures in one stack."""
    place = 0
    with hdf5_to_write(path) as file:
        chunks = (min(_CHUNK, part.num_events), 4)
        table = file.create_dataset(
            "davis/left/events", (part.num_events, 4), "f8", chunks=chunks, compression="gzip", shuffle=True
        )
        for events in part.blocks():
            span = slice(place, place + len(events))
            table[span] = np.stack([events.x, events.y, events.t / 1e6, events.p], 1)
            place = span.stop
            file.check()
        _write_stack(part, file)
        _write_the_rest(part, file)
    return without_colour(part, "MVSEC's have no colours") + without_flow(part)


def _write_stack(part: Part, file: WrittenFile) -> None:
    frames, truth = part.frames(), part.recording.ground_truth
    if truth is None or not len(frames):
        return
    height, width = truth.read_frame(frames[0]).shape
    white, kind = part.white
    shape, options = (len(frames), height, width), {"chunks": (1, height, width), "compression": "gzip"}
    images = file.create_dataset("davis/left/image_raw", shape, kind, **options)
    if white != 255:
        images.attrs["white"] = white
    stamps, indices = np.empty(len(frames)), np.empty(len(frames), np.int64)
    for number, (stamp, pixels) in enumerate(part.pictures(has_colour=False)):
        images[number] = pixels
        stamps[number], indices[number] = stamp / 1e6, _index_before(part, stamp)
        file.check()
    file["davis/left/image_raw_ts"], file["davis/left/image_raw_event_inds"] = stamps, indices


def _write_images(part: Part, file: WrittenFile) -> int:
    white, number = part.white[0], 0
    for number, (stamp, pixels) in enumerate(part.pictures(has_colour=True), 1):
        image = file.create_dataset(f"images/image{number - 1:09d}", data=pixels, compression="gzip")
        if white != 255:
            # No part of the layout; without it a reader cannot tell dark frames from those of fewer bits.
            image.attrs["white"] = white
        image.attrs["size"] = np.array(pixels.shape)
        image.attrs["type"] = "greyscale" if pixels.ndim == 2 else "color_bgr"
        image.attrs["timestamp"], image.attrs["event_idx"] = stamp / 1e6, _index_before(part, stamp)
        file.check()
    return number


def _write_flow(part: Part, file: WrittenFile) -> int:
    """As velocities (px/s), which the layout's loaders multiply by the time since the frame before."""
    truth = part.recording.ground_truth
    if truth is None or truth.read_flow is None:
        return 0
    number = 0
    for index in part.frames():
        try:
            flow = truth.read_flow(index)
        except RecordingError:
            continue  # none is stored for this frame
        # The first one has no frame before it in this file.
        is_first = index == part.frames()[0]
        seconds = 1.0 if is_first else (truth.stamps[index] - truth.stamps[index - 1]) * 1e-6
        if seconds <= 0:
            continue
        velocity = np.zeros_like(flow) if is_first else (flow / seconds).astype(np.float32)
        part.progress(1.0)
        stamp = int(truth.stamps[index])
        data = file.create_dataset(f"flow/flow{number:09d}", data=velocity, compression="gzip")
        data.attrs["size"], data.attrs["timestamp"] = np.array(flow.shape), stamp / 1e6
        data.attrs["event_idx"], data.attrs["unit"] = _index_before(part, stamp), "px/s"
        number += 1
        file.check()
    return number


def _index_before(part: Part, stamp: int) -> int:
    """event_packagers' own rule: the event just before the frame, and the first one for an earlier frame."""
    return max(0, part.recording.index_at(stamp) - 1 - part.start)


def _write_the_rest(part: Part, file: h5py.File) -> None:
    """No part of any layout but event_utils': the sensor's size, the triggers, how it was made."""
    file.attrs["sensor_resolution"] = np.array([part.recording.sensor.height, part.recording.sensor.width])
    for name, text in part.attributes().items():
        file.attrs[name] = text
    triggers = part.triggers()
    if triggers is None or len(triggers) == 0:
        return
    columns: dict[str, Any] = {"t": triggers.stamps, "channel": triggers.channels, "edge": triggers.edges}
    for name, column in columns.items():
        file[f"triggers/{name}"] = column
