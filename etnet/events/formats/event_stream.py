"""Event Stream (.es), through `faery`, which turns its y over: the format counts it from the bottom."""

from __future__ import annotations

import struct

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Format, Opened, Remarks, Request, contained
from etnet.events.formats.decode import Collected, collect
from etnet.events.formats.packets import Packets

_KINDS = {0: "generic", 1: "dvs", 2: "atis", 3: "colour"}
_READ = (1, 2)
_ROUGH_BYTES = 5


def _open(request: Request) -> Opened:
    remarks = Remarks()
    if len(request.head) < 20:
        raise RecordingError(f"{request.name}: its Event Stream header is cut off; the file is truncated")
    kind = request.head[15]
    if kind not in _READ:
        raise RecordingError(f"{request.name}: Event Stream of type {_KINDS.get(kind, kind)}; dvs and atis are read")
    width, height = struct.unpack_from("<HH", request.head, 16)
    if not (width and height):
        raise RecordingError(f"{request.name}: its header gives the sensor {width} × {height}; sides are 1 … 65,536")
    label = f"Event Stream {_KINDS[kind]}"
    collected = _through_faery(request, label, Sensor(width, height), remarks)
    remarks.detected("y is counted from the bottom in this format and was turned over")
    return Opened(label, collected.source, collected.sensor, collected.span, tuple(remarks.kept))


def _through_faery(request: Request, kind: str, declared: Sensor, remarks: Remarks) -> Collected:
    import faery  # here, because its import takes a seventh of the viewer's start

    with contained(request.name, kind):
        stream = iter(faery.events_stream_from_file(request.path))
    packets = Packets(request, kind, _ROUGH_BYTES, lambda: next(stream, None))
    collected = collect(request, packets.pieces(), declared, remarks)
    if collected.source.num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if packets.break_off is not None:
        remarks.repaired(packets.break_off)
    return collected


EVENT_STREAM = Format("Event Stream", (".es",), lambda request: request.head[:12] == b"Event Stream", _open)
