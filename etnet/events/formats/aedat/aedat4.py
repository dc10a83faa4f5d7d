"""AEDAT 4 (iniVation DV): events and frames of one camera, through the `aedat` library. Stamps are Unix-epoch µs."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import aedat
import numpy as np

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache
from etnet.events.events import Sensor
from etnet.events.formats.aedat4_header import check_header
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.bounds import declared_sensor
from etnet.events.formats.declared_size import unless_stated
from etnet.events.formats.decode import collect
from etnet.events.formats.foreign import listed
from etnet.events.formats.frames import Frames, attached
from etnet.events.formats.imu import InertialTable
from etnet.events.formats.packets import Packets
from etnet.events.formats.trigger_table import TriggerTable
from etnet.events.provenance import provenance_of
from etnet.events.recording import GroundTruth, Span

_ROUGH_BYTES_PER_EVENT = 6
_EDGES = {1: 1, 2: -1, 3: 0}
"""A trigger's source as dv-processing numbers it: an external signal's rising edge, falling edge, pulse."""


@dataclass
class _Others:
    """What lies between the events."""

    frames: FrameCache
    stamps: list[int] = field(default_factory=list)
    motion: InertialTable = field(default_factory=InertialTable)
    triggers: TriggerTable = field(default_factory=TriggerTable)
    num_marks: int = 0
    num_odd_frames: int = 0
    first: np.ndarray | None = None


def _open(request: Request) -> Opened:
    remarks = Remarks()
    described = check_header(request.path)
    with contained(request.name, "AEDAT4"):
        decoder = aedat.Decoder(request.path)
        streams: dict[int, dict[str, Any]] = decoder.id_to_stream()
    event_streams = sorted(key for key, stream in streams.items() if stream["type"] == "events")
    frame_streams = sorted(key for key, stream in streams.items() if stream["type"] == "frame")
    if not event_streams and not frame_streams:
        raise RecordingError(f"{request.name}: an AEDAT4 file without events and frames; nothing to open")
    wanted = _wanted_stream(event_streams, request, remarks)
    camera = frame_streams[0] if wanted is None else wanted
    size = streams[camera]
    where = f"{request.name}: its header"
    most = request.assume.max_pixels
    sensor = unless_stated(request, lambda: declared_sensor(size["width"], size["height"], where, most))
    others = _Others(FrameCache(request.scratch))
    kinds = {number: str(stream["type"]) for number, stream in streams.items()}
    own = own_streams(kinds, camera, event_streams or frame_streams, described.sources)
    _say_streams(kinds, own, remarks)
    packets = Packets(request, "AEDAT4", _ROUGH_BYTES_PER_EVENT, lambda: _next_events(decoder, wanted, own, others))
    collected = collect(request, packets.pieces(), sensor, remarks)
    if collected.source.num_events == 0 and len(others.frames) == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if packets.break_off is not None:
        remarks.repaired(packets.break_off)
    _say(others, collected.source.num_events, remarks)
    truth = _truth(others, collected.span, request.name, remarks, described.attributes.get("white", ""))
    inertial = others.motion.inertial(remarks)
    triggers = others.triggers.triggers(remarks)
    return Opened(
        "AEDAT4",
        collected.source,
        collected.sensor,
        collected.span,
        tuple(remarks.kept),
        truth,
        inertial,
        triggers=triggers,
        provenance=provenance_of(described.attributes),
    )


def _wanted_stream(streams: list[int], request: Request, remarks: Remarks) -> int | None:
    """The stream that a person names, else the first."""
    topic, numbers = request.assume.topic, ", ".join(map(str, streams))
    if topic is not None and topic not in map(str, streams):
        raise RecordingError(
            f'{request.name}: no event stream "{topic[:40]}"; its event streams are {numbers or "none"}'
        )
    if len(streams) < 2:
        return streams[0] if streams else None
    wanted = streams[0] if topic is None else int(topic)
    remarks.detected(f"event streams {numbers}; number {wanted} is shown (--topic NUMBER chooses)")
    return wanted


def own_streams(
    kinds: Mapping[int, str], camera: int, cameras: list[int], sources: Mapping[int, str]
) -> frozenset[int]:
    """Stream `camera`, and of each kind those that go with it, of frames the first one; `cameras` ascend.

    They tell by their sources, as dv-processing's writer for two cameras names them. One without a source belongs to
    the camera before it, unless all cameras come first: then numbers tell nothing.
    """
    source = sources.get(camera)
    foreign = {sources[number] for number in cameras if number in sources} - {source}
    beside = sorted(number for number in kinds if number not in cameras)
    is_grouped = any(number < cameras[-1] for number in beside)

    def belongs(number: int) -> bool:
        if source is not None and number in sources:
            return sources[number] not in foreign
        return not is_grouped or cameras[max(0, bisect_right(cameras, number) - 1)] == camera

    own = {camera}
    for kind in {kinds[number] for number in beside}:
        there = [number for number in beside if kinds[number] == kind and belongs(number)]
        there = [number for number in there if sources.get(number) == source] or there
        own.update(there[:1] if kind == "frame" else there)
    return frozenset(own)


def _say_streams(kinds: Mapping[int, str], own: Collection[int], remarks: Remarks) -> None:
    """Which streams are shown, where there are some that are not."""
    for kind, name in (("frame", "frames"), ("imus", "inertial samples"), ("triggers", "triggers")):
        there = sorted(number for number, each in kinds.items() if each == kind)
        shown = [number for number in there if number in own]
        if len(shown) < len(there):
            which = f"of stream {_listed(shown)} are shown" if shown else "are not shown, being another camera's"
            remarks.detected(f"{name} are in streams {_listed(there)}; those {which}")


def _listed(numbers: list[int]) -> str:
    return listed([str(number) for number in numbers])


def _next_events(
    decoder: Iterable[dict[str, Any]], wanted: int | None, own: Collection[int], others: _Others
) -> np.ndarray | None:
    """The next packet of events; what lies between in the camera's own streams is kept or counted."""
    for packet in decoder:
        if "events" in packet and packet["stream_id"] == wanted:
            return packet["events"]
        if packet["stream_id"] not in own:
            continue
        if "frame" in packet:
            _keep_frame(packet["frame"], others)
        elif "imus" in packet:
            _keep_motion(packet["imus"], others)
        elif "triggers" in packet:
            _keep_triggers(packet["triggers"], others)
    return None


def _keep_motion(samples: np.ndarray, others: _Others) -> None:
    acceleration, rotation = (
        np.stack([samples[f"{what}_{axis}"] for axis in "xyz"], 1) for what in ("accelerometer", "gyroscope")
    )
    others.motion.add(samples["t"].astype(np.int64), acceleration, rotation)


def _keep_triggers(records: np.ndarray, others: _Others) -> None:
    """Edges on the camera's input. Its own marks, such as a frame's beginning and a clock's reset, are counted."""
    is_trigger = np.isin(records["source"], list(_EDGES))
    others.num_marks += int(len(records) - np.count_nonzero(is_trigger))
    kept = records[is_trigger]
    edges = np.array([_EDGES[int(source)] for source in kept["source"]], np.int8)
    others.triggers.add(kept["t"].astype(np.int64), 0, edges)


def _keep_frame(frame: dict[str, Any], others: _Others) -> None:
    pixels = np.asarray(frame["pixels"])
    if others.first is None:
        others.first = pixels
    if pixels.shape != others.first.shape or pixels.dtype != others.first.dtype or pixels.size == 0:
        others.num_odd_frames += 1
        return
    others.frames.append(pixels)
    others.stamps.append(int(frame["t"]))


def _truth(others: _Others, span: Span, name: str, remarks: Remarks, white: str) -> GroundTruth | None:
    """`white`: what our own files say of it, for 16 bits may hold dark frames or those of fewer bits."""
    if others.first is None or len(others.frames) == 0:
        return None
    stamps, size = np.array(others.stamps, np.int64), Sensor(others.first.shape[1], others.first.shape[0])
    stated = float(white) if white in ("255", "65535") else None
    return attached(Frames(stamps, "us", others.frames.__getitem__, size, white=stated), span, "us", name, remarks)


def _say(others: _Others, num_events: int, remarks: Remarks) -> None:
    if num_events == 0:
        remarks.detected("there are frames and no events")
    if others.num_odd_frames:
        remarks.repaired(f"{others.num_odd_frames} frames of another size or type were left out")
    if others.num_marks:
        remarks.detected(f"{others.num_marks} marks of the camera's own (frames, exposures, resets), not read further")


AEDAT4 = Format("AEDAT4", (".aedat4", ".aedat"), lambda request: request.head[:12] == b"#!AER-DAT4.0", _open)
