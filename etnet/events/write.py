"""Write a recording, or a part of it, in another format. A file appears whole or not at all."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

import faery
import h5py
import hdf5plugin
import numpy as np
from faery.file_encoder import events_to_file

from etnet.errors import RecordingError
from etnet.events.assumptions import Progress
from etnet.events.events import Events
from etnet.events.formats.base import contained
from etnet.events.formats.hdf5.writing import hdf5_to_write
from etnet.events.formats.prophesee.clock import mark_turns
from etnet.events.formats.prophesee.trigger_words import MOST_CHANNELS, put_triggers
from etnet.events.recording import Recording, Remark
from etnet.events.triggers import Triggers
from etnet.files import check_target, replacing

Layout = Literal["event_utils", "dsec", "aedat4", "evt3", "csv", "npz"]

_SUFFIXES: dict[str, Layout] = {
    ".h5": "event_utils",
    ".hdf5": "event_utils",
    ".aedat4": "aedat4",
    ".raw": "evt3",
    ".csv": "csv",
    ".npz": "npz",
}
_BLOCK = 1 << 18
_CHUNK = 32_768
_EVT3_SIDE = 2048


@dataclass(frozen=True)
class _Part:
    """Events start … stop − 1 of a recording, and how to tell that they are being written."""

    recording: Recording
    start: int
    stop: int
    progress: Progress
    span: tuple[int, int] | None = None

    @property
    def num_events(self) -> int:
        return self.stop - self.start

    def blocks(self) -> Iterator[Events]:
        """The events in order, a block at a time."""
        for first in range(self.start, self.stop, _BLOCK):
            last = min(first + _BLOCK, self.stop)
            yield self.recording.read(first, last)
            self.progress((last - self.start) / self.num_events)

    def first_stamp(self) -> int:
        return int(self.recording.read(self.start, self.start + 1).t[0])

    def last_stamp(self) -> int:
        return int(self.recording.read(self.stop - 1, self.stop).t[0])


def layout_of(path: Path, layout: Layout | None = None) -> Layout:
    """The layout that a file is written in, judged by its suffix if none is given. Raises RecordingError."""
    chosen = layout or _SUFFIXES.get(path.suffix.lower())
    if chosen not in _WRITERS:
        raise RecordingError(
            f'{path.name}: no layout is known for "{path.suffix}"; name one of {", ".join(get_args(Layout))}'
        )
    return chosen


def write_recording(
    recording: Recording,
    path: str | Path,
    layout: Layout | None = None,
    *,
    start: int = 0,
    stop: int | None = None,
    span: tuple[int, int] | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> tuple[Remark, ...]:
    """Write events start … stop − 1 (all by default) with the frames among them, where the layout has frames.

    `span` (µs, both ends included) is the stretch that the events stand for, where it is longer than from the first of
    them to the last: the frames at its ends are written too. `layout` is judged by the suffix if not given. What the
    layout cannot hold is told in the remarks. Raises RecordingError if the file is there already, if the layout cannot
    hold the events, or if the disk fails; EtnetError if what is there is no regular file.
    """
    path = Path(path)
    chosen = layout_of(path, layout)
    stop = recording.num_events if stop is None else stop
    if not 0 <= start < stop <= recording.num_events:
        raise RecordingError(
            f"{recording.name}: cannot write events {start} … {stop} of {recording.num_events}; choose at least one"
        )
    check_target(path)
    if path.exists() and not overwrite:
        raise RecordingError(f"{path.name}: is there already; choose another name or allow overwriting")
    part = _Part(recording, start, stop, progress or (lambda _: None), span)
    # The suffix stays last, for some writers go by it.
    with (
        contained(path.name, f"events into {chosen}", "write", "check the disk and the folder"),
        replacing(path, suffix=path.suffix) as unfinished,
    ):
        remarks = _WRITERS[chosen](part, unfinished)
    return remarks + _without_motion(recording) + (() if chosen == "evt3" else _without_triggers(recording, chosen))


def _write_event_utils(part: _Part, path: Path) -> tuple[Remark, ...]:
    """TimoStoff/event_utils, lib/data_formats/event_packagers.py: what ET-Net and E2VID+ are trained with."""
    sensor, first, last = part.recording.sensor, part.first_stamp(), part.last_stamp()
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
        num_frames = _write_frames(part, file, first, last)
        file.attrs["num_events"], file.attrs["num_pos"] = part.num_events, num_on
        file.attrs["num_neg"], file.attrs["duration"] = part.num_events - num_on, (last - first) / 1e6
        file.attrs["t0"], file.attrs["tk"] = first / 1e6, last / 1e6
        file.attrs["num_imgs"], file.attrs["num_flow"] = num_frames, 0
        file.attrs["sensor_resolution"] = np.array([sensor.height, sensor.width])
    if num_frames and part.recording.ground_truth is not None and part.recording.ground_truth.read_flow is not None:
        return (Remark("detected", "the optical flow was not written"),)
    return ()


def _write_frames(part: _Part, file: h5py.File, first: int, last: int) -> int:
    """Frames from the last one at or before the first event, or `span`, to the last one at or before its end.

    Those that were finer than 8 bits are written with 16.
    """
    truth = part.recording.ground_truth
    if truth is None:
        return 0
    if part.span is not None:
        first, last = min(first, part.span[0]), max(last, part.span[1])
    begin = max(0, int(np.searchsorted(truth.stamps, first, "right")) - 1)
    end = int(np.searchsorted(truth.stamps, last, "right"))
    for number, index in enumerate(range(begin, end)):
        part.progress(1.0)  # it can be stopped between frames, too
        stamp = int(truth.stamps[index])
        white, kind = (255, np.uint8) if truth.white == 255 else (65_535, np.uint16)
        pixels = np.rint(np.clip(truth.read_frame(index), 0, 1) * white).astype(kind)
        image = file.create_dataset(f"images/image{number:09d}", data=pixels, compression="gzip")
        if white != 255:
            # No part of the layout; without it a reader cannot tell dark frames from those of fewer bits.
            image.attrs["white"] = white
        image.attrs["size"], image.attrs["type"] = np.array(pixels.shape), "greyscale"
        image.attrs["timestamp"] = stamp / 1e6
        # event_packagers' own rule: the event just before the frame, and the first one for an earlier frame.
        image.attrs["event_idx"] = max(0, part.recording.index_at(stamp) - 1 - part.start)
    return max(0, end - begin)


def _write_dsec(part: _Part, path: Path) -> tuple[Remark, ...]:
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
        # No part of the layout, which is that of one camera; event_utils' attribute, which our reader takes here too.
        file.attrs["sensor_resolution"] = np.array([part.recording.sensor.height, part.recording.sensor.width])
    return _without_frames(part, "DSEC keeps its pictures in files of their own")


def _write_through_faery(part: _Part, path: Path, kind: Literal["aedat", "evt"]) -> None:
    sensor = part.recording.sensor
    if part.first_stamp() < 0:
        raise RecordingError(f"{path.name}: stamps below 0 cannot be written; the format counts from 0")

    def packets() -> Iterator[np.ndarray]:
        for events in part.blocks():
            packet = np.empty(len(events), faery.EVENTS_DTYPE)
            packet["t"], packet["x"], packet["y"], packet["on"] = events.t, events.x, events.y, events.p > 0
            yield packet

    events_to_file(
        packets(),
        path,
        (sensor.width, sensor.height),
        version="evt3" if kind == "evt" else None,
        zero_t0=kind == "evt",
        file_type=kind,
        use_write_suffix=False,
    )


def _write_aedat4(part: _Part, path: Path) -> tuple[Remark, ...]:
    _write_through_faery(part, path, "aedat")
    return _without_frames(part, "its writer knows events alone")


def _write_evt3(part: _Part, path: Path) -> tuple[Remark, ...]:
    sensor = part.recording.sensor
    if max(sensor.width, sensor.height) > _EVT3_SIDE:
        raise RecordingError(f"{path.name}: a sensor of {sensor} does not fit EVT3, whose sides end at {_EVT3_SIDE}")
    _write_through_faery(part, path, "evt")
    mark_turns(path)
    unwritten = _write_triggers(part, path)
    said = Remark("detected", "timestamps begin at the first event; its own timestamp stands in the header's t0")
    return (said, *unwritten, *_without_frames(part, "EVT3 has none"))


def _write_triggers(part: _Part, path: Path) -> tuple[Remark, ...]:
    """Those among the events, on the file's own clock."""
    triggers = part.recording.triggers
    if triggers is None:
        return ()
    first, last = part.first_stamp(), part.last_stamp()
    start, stop = np.searchsorted(triggers.stamps, [first, last + 1])
    kept = Triggers(triggers.stamps[start:stop] - first, triggers.channels[start:stop], triggers.edges[start:stop])
    put_triggers(path, kept)
    said = [f"{len(kept)} triggers among the events were written"] if len(kept) else []
    if unknown := np.count_nonzero(kept.edges == 0):
        said.append(f"{unknown} triggers whose edge is not known were written as rising ones")
    if beyond := np.count_nonzero(kept.channels >= MOST_CHANNELS):
        said.append(f"{beyond} triggers were written with another input's number, for EVT3 counts inputs up to 15")
    return tuple(Remark("detected", text) for text in said)


def _write_csv(part: _Part, path: Path) -> tuple[Remark, ...]:
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("t_us,x,y,p\n")
        for events in part.blocks():
            rows = zip(events.t.tolist(), events.x.tolist(), events.y.tolist(), (events.p > 0).tolist(), strict=True)
            file.writelines(f"{t},{x},{y},{p:d}\n" for t, x, y, p in rows)
    sensor = part.recording.sensor
    size = f"open it with --assume width={sensor.width},height={sensor.height}"
    said = Remark("detected", f"the sensor's size, {sensor}, was not written: CSV has no place for it; {size}")
    return (said, *_without_frames(part, "CSV has none"))


def _write_npz(part: _Part, path: Path) -> tuple[Remark, ...]:
    """Column by column, a block at a time, so that no recording is too large."""
    sensor = part.recording.sensor
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for axis, dtype in (("x", "<u2"), ("y", "<u2"), ("t", "<i8"), ("p", "|i1")):
            with archive.open(f"{axis}.npy", "w", force_zip64=True) as member:
                header = {"descr": dtype, "fortran_order": False, "shape": (part.num_events,)}
                np.lib.format.write_array_header_1_0(member, header)
                for events in part.blocks():
                    member.write(getattr(events, axis).astype(dtype, copy=False).tobytes())
        for name, value in (("width", sensor.width), ("height", sensor.height)):
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, np.array(value))
    return _without_frames(part, "these columns have none")


def _without_frames(part: _Part, why: str) -> tuple[Remark, ...]:
    if part.recording.ground_truth is None:
        return ()
    return (Remark("detected", f"the camera's frames were not written: {why}"),)


def _without_motion(recording: Recording) -> tuple[Remark, ...]:
    if recording.inertial is None:
        return ()
    num_samples = len(recording.inertial)
    return (Remark("detected", f"{num_samples} samples of the camera's motion were not written: no layout has them"),)


def _without_triggers(recording: Recording, layout: Layout) -> tuple[Remark, ...]:
    if recording.triggers is None:
        return ()
    text = f"{len(recording.triggers)} triggers were not written: {layout} has no place for them here, EVT3 has"
    return (Remark("detected", text),)


_WRITERS: dict[str, Callable[[_Part, Path], tuple[Remark, ...]]] = {
    "event_utils": _write_event_utils,
    "dsec": _write_dsec,
    "aedat4": _write_aedat4,
    "evt3": _write_evt3,
    "csv": _write_csv,
    "npz": _write_npz,
}
