"""AEDAT 4 (iniVation DV): events and frames of one camera, through the `aedat` library. Stamps are Unix-epoch µs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import aedat
import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache, grey
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.collect import Decoded, collect
from etnet.events.formats.pictures import in_order
from etnet.events.recording import GroundTruth

_LARGEST_STAMP = 2**62
_ROUGH_BYTES_PER_EVENT = 6


@dataclass
class _Others:
    """What lies between the events."""

    frames: FrameCache
    stamps: list[int] = field(default_factory=list)
    num_inertial: int = 0
    num_triggers: int = 0
    num_odd_frames: int = 0
    first: np.ndarray | None = None
    is_cut: str | None = None


def _open(request: Request) -> Opened:
    remarks = Remarks()
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
    pieces = _pieces(request, decoder, wanted, frame_streams[0] if frame_streams else None, others)
    collected = collect(request, pieces, Sensor(int(size["width"]), int(size["height"])), remarks)
    if collected.source.num_events == 0 and len(others.frames) == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    _say(others, collected.source.num_events, remarks)
    return Opened(
        "AEDAT4", collected.source, collected.sensor, collected.span, tuple(remarks.kept), _truth(others, remarks)
    )


def _pieces(
    request: Request, decoder: aedat.Decoder, wanted: int | None, frames: int | None, others: _Others
) -> Iterator[Decoded]:
    size = max(1, request.path.stat().st_size)
    num_events = 0
    while True:
        try:
            with contained(request.name, f"AEDAT4 after event {num_events}"):
                packet = next(decoder, None)
        except RecordingError as slip:
            if num_events == 0:
                raise
            others.is_cut = str(slip.__cause__)
            return
        if packet is None:
            return
        if "events" in packet and packet["stream_id"] == wanted:
            events = packet["events"]
            num_events += len(events)
            if len(events) and int(events["t"].max()) >= _LARGEST_STAMP:
                raise RecordingError(f"{request.name}: stamps near event {num_events} are no time; the file is damaged")
            fraction = num_events * _ROUGH_BYTES_PER_EVENT / size
            yield Decoded(events["x"], events["y"], events["t"].astype(np.int64), events["on"], fraction)
        elif "frame" in packet and packet["stream_id"] == frames:
            _keep_frame(packet["frame"], others)
        elif "imus" in packet:
            others.num_inertial += len(packet["imus"])
        elif "triggers" in packet:
            others.num_triggers += len(packet["triggers"])


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
    if others.is_cut is not None:
        remarks.repaired(f"the file breaks off after event {num_events} ({others.is_cut}); what comes before is kept")
    if num_events == 0:
        remarks.detected("there are frames and no events")
    if others.num_odd_frames:
        remarks.repaired(f"{others.num_odd_frames} frames of another size or type were left out")
    for number, what in ((others.num_inertial, "inertial samples"), (others.num_triggers, "triggers")):
        if number:
            remarks.detected(f"{number} {what}, which are not read further")


AEDAT4 = Format("AEDAT4", (".aedat4", ".aedat"), lambda request: request.head[:12] == b"#!AER-DAT4.0", _open)
