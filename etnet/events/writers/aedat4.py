"""AEDAT 4: packets that are appended to the file, so that a kill costs the last packet at most.

Layout: inivation.com, "AEDAT file formats", 4.0: a version line, a header, then packets of (stream, size) and a
FlatBuffer in an LZ4 frame. The FlatBuffers have few fields and always the same ones, so they are laid out by hand; all
places below count from the length that stands before them. No table of packets is written: readers that want one make
it, as they do for a recording that was cut short.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from contextlib import closing
from html import escape
from pathlib import Path

import lz4.frame
import numpy as np
from jaxtyping import Shaped

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import Remark
from etnet.events.triggers import Triggers
from etnet.events.writers.part import Part, without_flow

PACKET = 65_536
"""Events in a packet at most."""
_VERSION = b"#!AER-DAT4.0\r\n"
_STREAMS = (
    ("events", "EVTS", "Array of events (polarity ON/OFF)."),
    ("frames", "FRME", "Standard frame (8-bit image)."),
    ("triggers", "TRIG", "External triggers and special signals."),
)
_EVENT = np.dtype({"names": ["t", "x", "y", "on"], "formats": ["<i8", "<i2", "<i2", "i1"], "itemsize": 16})
_TRIGGER = np.dtype([("to_fields", "<i4"), ("t", "<i8"), ("type", "i1"), ("", "V3")])
_RISING, _FALLING, _PULSE = 1, 2, 3


class Aedat4File:
    """Appends packets. `attributes` go into the description of the streams, as words beside their size."""

    def __init__(self, path: Path, sensor: Sensor, attributes: Mapping[str, str]) -> None:
        if max(sensor.width, sensor.height) > 32_767:
            raise RecordingError(f"{path.name}: a sensor of {sensor} does not fit AEDAT4; take .h5")
        self.num_events = 0
        self._name = path.name
        self._file = path.open("wb")
        self._file.write(_VERSION + _header(sensor, attributes))
        self._file.flush()

    def add_events(self, events: Events) -> None:
        """More events, in order."""
        for start in range(0, len(events), PACKET):
            part = events[start : start + PACKET]
            if part.t[0] < 0:
                raise RecordingError(f"{self._name}: the stamp {part.t[0]} µs is below 0; take .h5")
            rows = np.zeros(len(part), _EVENT)
            rows["t"], rows["x"], rows["y"], rows["on"] = part.t, part.x, part.y, part.p > 0
            self._packet(0, _vector_of(b"EVTS", len(rows), rows.tobytes()))
        self.num_events += len(events)

    def add_picture(self, stamp: int, pixels: Shaped[np.ndarray, "h w *c"]) -> None:
        """One picture of 8 or 16 bits; a colour one is blue, green, red."""
        self._packet(1, _picture(stamp, pixels))

    def add_triggers(self, triggers: Triggers) -> None:
        """More triggers, in order. The format knows edges and no channels."""
        if len(triggers):
            self._packet(2, _trigger_packet(triggers))

    def flush(self) -> None:
        """What was given so far is in the file from here on."""
        self._file.flush()

    def close(self) -> None:
        """Finish the file."""
        self._file.close()

    def _packet(self, stream: int, content: bytes) -> None:
        packed = lz4.frame.compress(content)
        self._file.write(struct.pack("<ii", stream, len(packed)) + packed)


def write_aedat4(part: Part, path: Path) -> tuple[Remark, ...]:
    """Events, frames and triggers by turns, in the order of time as far as packets allow."""
    if part.first_stamp() < 0:
        raise RecordingError(f"{path.name}: stamps below 0 cannot be written; the format counts from 0")
    triggers, pictures = part.triggers(), part.pictures(has_colour=True)
    attributes = {"white": str(part.white[0]), **part.attributes()}
    with closing(Aedat4File(path, part.recording.sensor, attributes)) as file:
        waiting = next(pictures, None)
        for events in part.blocks():
            start = 0
            while waiting is not None and waiting[0] <= events.t[-1]:
                stop = int(np.searchsorted(events.t, waiting[0]))
                file.add_events(events[start:stop])
                file.add_picture(*waiting)
                start, waiting = stop, next(pictures, None)
            file.add_events(events[start:])
        while waiting is not None:
            file.add_picture(*waiting)
            waiting = next(pictures, None)
        if triggers is not None:
            file.add_triggers(triggers)
    said: tuple[Remark, ...] = ()
    if triggers is not None and np.any(triggers.channels != 0):
        said = (Remark("detected", "the triggers' inputs were not written: AEDAT4 does not count them"),)
    return said + without_flow(part)


def _header(sensor: Sensor, attributes: Mapping[str, str]) -> bytes:
    """Compression LZ4, no table of packets (−1), the streams' description as XML."""
    description = _description(sensor, attributes).encode()
    # Fields in the table: 0 compression, 2 the description's place, 1 where the table of packets lies.
    fields = struct.pack("<HHHHH", 10, 20, 4, 12, 8)
    table = struct.pack("<iiiq", 16, 1, 12, -1)
    text = struct.pack("<I", len(description)) + description + b"\0"
    body = struct.pack("<I", 24) + b"IOHE" + fields + bytes(6) + table + text
    body += bytes(-len(body) % 4)
    return struct.pack("<I", len(body)) + body


def _description(sensor: Sensor, attributes: Mapping[str, str]) -> str:
    top = "/mainloop/Recorder/outInfo/"
    size = f'<attr key="sizeX" type="int">{sensor.width}</attr><attr key="sizeY" type="int">{sensor.height}</attr>'
    more = "".join(f'<attr key="{key}" type="string">{escape(text, False)}</attr>' for key, text in attributes.items())
    nodes = "".join(
        f'<node name="{number}" path="{top}{number}/"><attr key="compression" type="string">LZ4</attr>'
        f'<attr key="originalModuleName" type="string">capture</attr>'
        f'<attr key="originalOutputName" type="string">{name}</attr>'
        f'<attr key="typeDescription" type="string">{words}</attr>'
        f'<attr key="typeIdentifier" type="string">{kind}</attr><node name="info" path="{top}{number}/info/">'
        f"{size if kind != 'TRIG' else ''}{more}</node></node>"
        for number, (name, kind, words) in enumerate(_STREAMS)
    )
    return f'<dv version="2.0"><node name="outInfo" path="{top}">{nodes}</node></dv>'


def _vector_of(kind: bytes, length: int, elements: bytes) -> bytes:
    """A table whose one field is a vector; the elements begin at place 32."""
    head = struct.pack("<I", 16) + kind + struct.pack("<HHH", 6, 8, 4) + bytes(2) + struct.pack("<iII", 8, 4, length)
    return struct.pack("<I", len(head) + len(elements)) + head + elements


def _trigger_packet(triggers: Triggers) -> bytes:
    """A vector of tables, each with the stamp and the kind of edge; all share one description of their fields."""
    num = len(triggers)
    fields_at = 32 + 4 * num
    first_at = fields_at + 8
    first_at += (4 - first_at) % 8  # a stamp lies 4 bytes into its table, at a multiple of 8
    tables = np.zeros(num, _TRIGGER)
    places = first_at + _TRIGGER.itemsize * np.arange(num)
    tables["to_fields"] = places - fields_at
    tables["t"] = triggers.stamps
    tables["type"] = np.choose(triggers.edges + 1, (_FALLING, _PULSE, _RISING))
    offsets = (places - (32 + 4 * np.arange(num))).astype("<u4").tobytes()
    fields = struct.pack("<HHHH", 8, 13, 4, 12)
    return _vector_of(b"TRIG", num, (offsets + fields).ljust(first_at - 32, b"\0") + tables.tobytes())


def _picture(stamp: int, pixels: Shaped[np.ndarray, "h w *c"]) -> bytes:
    """One picture; its five stamps are one. Its type is numbered as OpenCV numbers types."""
    height, width = pixels.shape[:2]
    kind = (16 if pixels.ndim == 3 else 0) + (2 if pixels.dtype.itemsize == 2 else 0)
    fields = struct.pack("<HH11H", 26, 60, 4, 12, 20, 28, 36, 44, 46, 48, 50, 52, 56)
    stamps = struct.pack("<5q", *(5 * [stamp]))
    table = struct.pack("<i", 32) + stamps + struct.pack("<bxhhhhxxI", kind, width, height, 0, 0, 4)
    content = struct.pack("<I", pixels.nbytes) + np.ascontiguousarray(pixels).tobytes()
    body = struct.pack("<I", 40) + b"FRME" + fields + bytes(6) + table + content
    return struct.pack("<I", len(body)) + body
