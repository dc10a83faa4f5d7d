"""AEDAT 3.1 (cAER): packets of change events and frames, 31-bit stamps with an overflow counter. Origin top left.

Layout: inivation.com, "AEDAT file formats", version 3.1.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.decode import Decoded, collect
from etnet.events.formats.frames import Frames, attached
from etnet.events.formats.trigger_table import TriggerTable
from etnet.events.recording import GroundTruth, Span

_PACKET = struct.Struct("<hhiiiiii")
_FRAME = struct.Struct("<I4i4i")
_SPECIAL, _POLARITY, _FRAMES, _IMU6, _IMU9 = range(5)
_TRIGGERS = {first + k: (i, edge) for i, first in enumerate((2, 6, 9)) for k, edge in enumerate((1, -1, 0))}
"""Types of special events that are edges: three inputs, each with a rising edge, a falling edge and a pulse."""
_END = b"#!END-HEADER"
_LARGEST_PACKET = 1 << 28
_CHIPS = (("davis240", Sensor(240, 180)), ("davis346", Sensor(346, 260)), ("dvs128", Sensor(128, 128)))


@dataclass
class _Others:
    frames: FrameCache
    stamps: list[int] = field(default_factory=list)
    shape: tuple[int, ...] = ()
    triggers: TriggerTable = field(default_factory=TriggerTable)
    num_special: int = 0
    num_motion: int = 0
    num_other: int = 0
    num_odd: int = 0
    num_invalid: int = 0
    is_cut: bool = False


def _open(request: Request) -> Opened:
    remarks = Remarks()
    with request.path.open("rb") as file:
        block = file.read(1 << 16)
    if block.startswith(b"#!AER-DAT3.0"):
        raise RecordingError(
            f"{request.name}: an AEDAT 3.0 file, whose y counts from the bottom and whose header may have no end; 3.1 "
            "is read: save it as AEDAT 3.1 RAW with cAER"
        )
    end = block.find(_END)
    stop = block.find(b"\n", end) + 1
    if end < 0 or stop == 0:
        raise RecordingError(f"{request.name}: its AEDAT 3 header has no end; the file is truncated")
    header = block[:stop].decode("latin-1")
    if "Format: RAW" not in header:
        raise RecordingError(f"{request.name}: a compressed AEDAT 3.1 file; save it as RAW with cAER or DV first")
    declared = next((sensor for chip, sensor in _CHIPS if chip in header.lower()), None)
    others = _Others(FrameCache(request.scratch))
    collected = collect(request, _pieces(request, stop, others), declared, remarks)
    if collected.source.num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    _say(others, remarks)
    truth, triggers = _truth(others, collected.span, request.name, remarks), others.triggers.triggers(remarks)
    kept = tuple(remarks.kept)
    return Opened("AEDAT 3.1", collected.source, collected.sensor, collected.span, kept, truth, triggers=triggers)


def _pieces(request: Request, start: int, others: _Others) -> Iterator[Decoded]:
    size = request.path.stat().st_size
    with request.path.open("rb") as file:
        file.seek(start)
        while head := file.read(_PACKET.size):
            if len(head) < _PACKET.size:
                others.is_cut = True
                return
            kind, _, event_size, _, overflow, _, number, _ = _PACKET.unpack(head)
            if event_size <= 0 or number < 0 or overflow < 0 or event_size * number > _LARGEST_PACKET:
                raise RecordingError(f"{request.name}: a packet of {number} × {event_size} bytes at byte {file.tell()}")
            payload = file.read(event_size * number)
            if len(payload) < event_size * number:
                others.is_cut = True
                number = len(payload) // event_size
                payload = payload[: number * event_size]
            if kind == _POLARITY and event_size == 8:
                yield _events(payload, overflow, others)._replace(fraction=file.tell() / size)
            elif kind == _FRAMES:
                _keep_frames(payload, event_size, overflow, others)
            elif kind in (_IMU6, _IMU9):
                others.num_motion += number
            elif kind == _SPECIAL:
                _keep_special(payload, event_size, overflow, others)
            else:
                others.num_other += number


def _events(payload: bytes, overflow: int, others: _Others) -> Decoded:
    words = np.frombuffer(payload, "<u4").reshape(-1, 2)
    is_valid = (words[:, 0] & 1) == 1
    others.num_invalid += int(len(words) - np.count_nonzero(is_valid))
    data, stamps = words[is_valid, 0], words[is_valid, 1].astype(np.int64)
    return Decoded(data >> 17, (data >> 2) & 0x7FFF, stamps + (overflow << 31), (data >> 1) & 1)


def _keep_special(payload: bytes, event_size: int, overflow: int, others: _Others) -> None:
    """Triggers by their input and edge; what else the camera tells of itself is counted."""
    if event_size != 8:
        others.num_special += len(payload) // max(1, event_size)
        return
    words = np.frombuffer(payload, "<u4").reshape(-1, 2)
    kind = (words[:, 0] >> 1) & 0x7F
    is_trigger = np.isin(kind, list(_TRIGGERS)) & ((words[:, 0] & 1) == 1)
    others.num_special += int(len(kind) - np.count_nonzero(is_trigger))
    told = np.array([_TRIGGERS[int(each)] for each in kind[is_trigger]], np.int64).reshape(-1, 2)
    others.triggers.add(words[is_trigger, 1].astype(np.int64) + (overflow << 31), told[:, 0], told[:, 1])


def _keep_frames(payload: bytes, event_size: int, overflow: int, others: _Others) -> None:
    for place in range(0, len(payload), event_size):
        event = payload[place : place + event_size]
        if len(event) < _FRAME.size:
            others.num_odd += 1
            continue
        info, _, _, opened, closed, width, height, _, _ = _FRAME.unpack_from(event)
        channels = (info >> 1) & 7
        shape = (height, width) if channels == 1 else (height, width, channels)
        num_bytes = 2 * width * height * channels
        fits = min(width, height, channels) > 0 and num_bytes <= len(event) - _FRAME.size
        if not (info & 1) or not fits or (others.shape and shape != others.shape):
            others.num_odd += 1
            continue
        others.shape = shape
        others.frames.append(np.frombuffer(event, "<u2", num_bytes // 2, _FRAME.size).reshape(shape))
        others.stamps.append((opened + closed) // 2 + (overflow << 31))


def _truth(others: _Others, span: Span, name: str, remarks: Remarks) -> GroundTruth | None:
    if len(others.frames) == 0:
        return None
    stamps, size = np.array(others.stamps, np.int64), Sensor(others.shape[1], others.shape[0])
    return attached(Frames(stamps, "us", others.frames.__getitem__, size), span, "us", name, remarks)


def _say(others: _Others, remarks: Remarks) -> None:
    if others.is_cut:
        remarks.repaired("the file breaks off within a packet; what comes before is kept")
    if others.num_invalid:
        remarks.repaired(f"{others.num_invalid} events that the camera marked as invalid were left out")
    if others.num_odd:
        remarks.repaired(f"{others.num_odd} frames that are invalid or of another size were left out")
    for number, what in (
        (others.num_motion, "samples of motion"),
        (others.num_special, "special events (clock resets, frame marks)"),
        (others.num_other, "other samples"),
    ):
        if number:
            remarks.detected(f"{number} {what}, which are not read further")


AEDAT3 = Format("AEDAT 3.1", (".aedat",), lambda request: request.head[:11] == b"#!AER-DAT3.", _open)
