"""AEDAT 4 (iniVation DV): events and frames of one camera, through the `aedat` library. Stamps are Unix-epoch µs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import aedat
import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache, grey
from etnet.events.events import Sensor
from etnet.events.formats.aedat4_header import check_header
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.camera_frames import in_order
from etnet.events.formats.decode import collect
from etnet.events.formats.imu import InertialTable
from etnet.events.formats.packets import Packets
from etnet.events.recording import GroundTruth

_ROUGH_BYTES_PER_EVENT = 6


@dataclass
class _Others:
    """What lies between the events."""

    frames: FrameCache
    stamps: list[int] = field(default_factory=list)
    motion: InertialTable = field(default_factory=InertialTable)
    num_triggers: int = 0
    num_odd_frames: int = 0
    first: np.ndarray | None = None


def _open(request: Request) -> Opened:
    remarks = Remarks()
    check_header(request.path)
    with contained(request.name, "AEDAT4"):
        decoder = aedat.Decoder(request.path)
        streams: dict[int, dict[str, Any]] = decoder.id_to_stream()
    event_streams = sorted(key for key, stream in streams.items() if stream["type"] == "events")
    frame_streams = sorted(key for key, stream in streams.items() if stream["type"] == "frame")
    if not event_streams and not frame_streams:
        raise RecordingError(f"{request.name}: an AEDAT4 file without events and frames; nothing to open")
    wanted = event_streams[0] if event_streams else None
    if len(event_streams) > 1:
        remarks.detected(f"{len(event_streams)} event streams; the first one (number {wanted}) is shown")
    size = streams[wanted if wanted is not None else frame_streams[0]]
    others = _Others(FrameCache(request.scratch))
    frames = frame_streams[0] if frame_streams else None
    packets = Packets(request, "AEDAT4", _ROUGH_BYTES_PER_EVENT, lambda: _next_events(decoder, wanted, frames, others))
    collected = collect(request, packets.pieces(), Sensor(int(size["width"]), int(size["height"])), remarks)
    if collected.source.num_events == 0 and len(others.frames) == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if packets.break_off is not None:
        remarks.repaired(packets.break_off)
    _say(others, collected.source.num_events, remarks)
    truth, inertial = _truth(others, remarks), others.motion.inertial(remarks)
    return Opened("AEDAT4", collected.source, collected.sensor, collected.span, tuple(remarks.kept), truth, inertial)


def _next_events(decoder: aedat.Decoder, wanted: int | None, frames: int | None, others: _Others) -> np.ndarray | None:
    """The next packet of events; what lies between is kept or counted."""
    for packet in decoder:
        if "events" in packet and packet["stream_id"] == wanted:
            return packet["events"]
        if "frame" in packet and packet["stream_id"] == frames:
            _keep_frame(packet["frame"], others)
        elif "imus" in packet:
            _keep_motion(packet["imus"], others)
        elif "triggers" in packet:
            others.num_triggers += len(packet["triggers"])
    return None


def _keep_motion(samples: np.ndarray, others: _Others) -> None:
    acceleration, rotation = (
        np.stack([samples[f"{what}_{axis}"] for axis in "xyz"], 1) for what in ("accelerometer", "gyroscope")
    )
    others.motion.add(samples["t"].astype(np.int64), acceleration, rotation)


def _keep_frame(frame: dict[str, Any], others: _Others) -> None:
    pixels = np.asarray(frame["pixels"])
    if others.first is None:
        others.first = pixels
    if pixels.shape != others.first.shape or pixels.dtype != others.first.dtype or pixels.size == 0:
        others.num_odd_frames += 1
        return
    others.frames.append(pixels)
    others.stamps.append(int(frame["t"]))


def _truth(others: _Others, remarks: Remarks) -> GroundTruth | None:
    if len(others.frames) == 0:
        return None

    def read_frame(index: int) -> Float32[np.ndarray, "h w"]:
        return grey(others.frames[index])

    stamps = np.array(others.stamps, np.int64)
    return in_order(stamps, GroundTruth(stamps, read_frame), remarks)


def _say(others: _Others, num_events: int, remarks: Remarks) -> None:
    if num_events == 0:
        remarks.detected("there are frames and no events")
    if others.num_odd_frames:
        remarks.repaired(f"{others.num_odd_frames} frames of another size or type were left out")
    if others.num_triggers:
        remarks.detected(f"{others.num_triggers} triggers, which are not read further")


AEDAT4 = Format("AEDAT4", (".aedat4", ".aedat"), lambda request: request.head[:12] == b"#!AER-DAT4.0", _open)
