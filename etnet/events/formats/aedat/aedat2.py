"""AEDAT 2.0 (jAER): eight-byte big-endian words of a DVS128, DAVIS240 or DAVIS346.

Layout: inivation.com, "AEDAT file formats", and the bits listed in jAER's chip classes. jAER counts y from the bottom.
Its extractors take an event's x from the right (`flipx`) and a picture's x as it is stored, so that both show the scene
the same way round; v2e writes its files for that.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from etnet.errors import RecordingError
from etnet.events.cache import FrameCache
from etnet.events.events import Sensor
from etnet.events.formats.aedat.aedat2_davis import Samples, first_pixel
from etnet.events.formats.base import Format, Opened, Remarks, Request
from etnet.events.formats.decode import Decoded, collect
from etnet.events.formats.rows_on_disk import RowsOnDisk
from etnet.events.formats.trigger_table import TriggerTable
from etnet.events.formats.word_stream import unrolled

_DVS128 = Sensor(128, 128)
_CHIPS = (("davis240", Sensor(240, 180)), ("davis346", Sensor(346, 260)), ("dvs128", _DVS128))
_BLOCK = 1 << 17
_LOOK = 1 << 21
"""Words at the file's beginning from which the order of the picture's readout is judged; a dozen pictures."""

_FARTHEST = Sensor(1 << 10, 1 << 9)
"""What the bits of a DAVIS address can reach."""

_PERIOD = 1 << 32
_LONGEST_HEADER = 16_000_000
_LONGEST_LINE = 1 << 18
_PRINTABLE = bytes((9, 13, *range(32, 256)))
_CHIP_LINE = re.compile(r"^#[ \t]*aechip[ \t]*:(.*)$", re.MULTILINE)


@dataclass
class _Other:
    """Words that are no change events."""

    samples: Samples
    triggers: TriggerTable = field(default_factory=TriggerTable)
    num_turns: int = 0


def _read_header(request: Request) -> bytes:
    """The lines that begin with #. Data may begin with that byte too, so a line must be printable."""
    header = bytearray()
    with request.path.open("rb") as file:
        while (line := file.readline(_LONGEST_LINE)).startswith(b"#") and line.endswith(b"\n"):
            if line[:-1].translate(None, _PRINTABLE):
                break
            header += line
            if len(header) > _LONGEST_HEADER:
                raise RecordingError(
                    f"{request.name}: its header of lines that begin with # takes more than "
                    f"{_LONGEST_HEADER / 1e6:g} MB; jAER writes less: shorten it, or save the recording again"
                )
    return bytes(header)


def _named_sensor(header: str) -> Sensor | None:
    """That of the line "AEChip:"; jAER may write the settings of every chip that it knows behind it."""
    line = _CHIP_LINE.search(header)
    told = header if line is None else line[1]
    return next((sensor for chip, sensor in _CHIPS if chip in told), None)


def _open(request: Request) -> Opened:
    remarks = Remarks()
    header = _read_header(request)
    size = request.path.stat().st_size - len(header)
    if size < 8:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    if size % 8:
        remarks.repaired(f"{size % 8} bytes after the last whole event were left out; the file may be truncated")
    words = RowsOnDisk(request.path, ">u4", len(header), (size // 8, 2))
    request.resources.callback(words.close)
    declared = _named_sensor(header.decode("latin-1").lower())
    chip = declared or _judged_sensor(words)
    if declared is None and request.assume.sensor is None:
        remarks.assumed(f"sensor {chip}: the header names no chip and the addresses fit it; --assume overrules")
        declared = chip
    sensor = request.assume.sensor or chip
    remarks.assumed("events are turned to how jAER shows them: y is stored from the bottom and x from the right")
    start = words[:_LOOK].astype(np.int64)
    # No address reaches farther, however large a sensor is stated.
    seen = Sensor(min(sensor.width, _FARTHEST.width), min(sensor.height, _FARTHEST.height))
    first = None if chip == _DVS128 else first_pixel(start[:, 0], start[:, 1], seen)
    other = _Other(Samples(seen, first, FrameCache(request.scratch)))
    collected = collect(request, _pieces(words, chip == _DVS128, sensor, other), declared, remarks)
    if collected.source.num_events == 0:
        raise RecordingError(f"{request.name}: holds no events; there is nothing to open")
    truth, inertial = other.samples.truth(remarks), other.samples.motion.inertial(remarks)
    if inertial is not None:
        remarks.assumed("motion is scaled for ±4 g and ±500 °/s, jAER's usual ranges")
    if other.num_turns > 0:
        remarks.repaired(f"the clock wraps {other.num_turns} times (every 71.6 minutes) and was unrolled")
    triggers = other.triggers.triggers(remarks)
    kept = tuple(remarks.kept)
    return Opened(
        "AEDAT 2.0", collected.source, collected.sensor, collected.span, kept, truth, inertial, triggers=triggers
    )


def _judged_sensor(words: RowsOnDisk) -> Sensor:
    """A DVS128 address has 15 bits; a DAVIS one reaches beyond 16."""
    sample = words[:: max(1, len(words) // 100_000), 0].astype(np.int64)
    if int(sample.max()) < 1 << 16:
        return _DVS128
    pixels = sample[(sample >> 31) == 0]
    reach = int(((pixels >> 22) & 0x1FF).max(initial=0)), int(((pixels >> 12) & 0x3FF).max(initial=0))
    return Sensor(240, 180) if reach[0] < 180 and reach[1] < 240 else Sensor(346, 260)


def _pieces(words: RowsOnDisk, is_dvs128: bool, sensor: Sensor, other: _Other) -> Iterator[Decoded]:
    last, turns = None, 0
    for start in range(0, len(words), _BLOCK):
        block = words[start : start + _BLOCK]
        address, stamps = block[:, 0].astype(np.int64), block[:, 1].astype(np.int64)
        t, turns = unrolled(stamps, _PERIOD, last, turns)
        last, other.num_turns = int(stamps[-1]), turns
        fraction = min(1.0, (start + _BLOCK) / len(words))
        if is_dvs128:
            is_event = (address >> 15) == 0
            other.triggers.add(t[~is_event], 0, 0)
            address, t = address[is_event], t[is_event]
            x, y, p = (address >> 1) & 0x7F, (address >> 8) & 0x7F, 1 - (address & 1)
        else:
            is_sample, is_external = (address >> 31) == 1, ((address >> 10) & 1) == 1
            other.samples.take(address[is_sample], t[is_sample])
            other.triggers.add(t[is_external & ~is_sample], 0, 0)
            is_event = ~(is_sample | is_external)
            address, t = address[is_event], t[is_event]
            x, y, p = (address >> 12) & 0x3FF, (address >> 22) & 0x1FF, (address >> 11) & 1
        width, height = sensor.width, sensor.height
        # What lies beyond the sensor stays there and is counted.
        x, y = np.where(x < width, width - 1 - x, x), np.where(y < height, height - 1 - y, y)
        yield Decoded(x, y, t, p, fraction)


AEDAT2 = Format("AEDAT 2.0", (".aedat", ".dat"), lambda request: request.head[:11] == b"#!AER-DAT2.", _open)
