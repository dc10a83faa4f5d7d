"""Streams that faery encodes: Prophesee's EVT 3.0 and Event Stream."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import numpy as np

from etnet.errors import RecordingError
from etnet.events.formats.prophesee.clock import mark_turns
from etnet.events.formats.prophesee.header import put_fields
from etnet.events.formats.prophesee.trigger_words import MOST_CHANNELS, put_triggers
from etnet.events.recording import Remark
from etnet.events.triggers import Triggers
from etnet.events.writers.part import Part, without_frames, without_triggers

_EVT3_SIDE = 2048
_STREAM_SIDE = 65_535
_LATEST_START = 60_000_000
"""First stamp (µs) that Event Stream keeps: it has a byte for each 127 µs before it."""


def write_evt3(part: Part, path: Path) -> tuple[Remark, ...]:
    """docs.prophesee.ai, "EVT 3.0 format"."""
    sensor = part.recording.sensor
    if max(sensor.width, sensor.height) > _EVT3_SIDE:
        raise RecordingError(f"{path.name}: a sensor of {sensor} does not fit EVT3, whose sides end at {_EVT3_SIDE}")
    _through_faery(part, path, "evt", begins_at_0=True)
    mark_turns(path)
    unwritten = _write_triggers(part, path)
    if part.attributes():
        put_fields(path, part.attributes())
    said = Remark("detected", "timestamps begin at the first event; its own timestamp stands in the header's t0")
    return (said, *unwritten, *without_frames(part, "EVT3 has none"))


def write_event_stream(part: Part, path: Path) -> tuple[Remark, ...]:
    """github.com/neuromorphicsystems/event_stream, version 2, type dvs: a byte for each 127 µs without events."""
    sensor, first = part.recording.sensor, part.first_stamp()
    if max(sensor.width, sensor.height) > _STREAM_SIDE:
        raise RecordingError(f"{path.name}: a sensor of {sensor} does not fit Event Stream, whose sides end at 65,535")
    keeps_stamps = 0 <= first <= _LATEST_START
    _through_faery(part, path, "es", begins_at_0=not keeps_stamps)
    moved = f"timestamps begin at the first event, {first} µs: Event Stream has no place for a later beginning"
    said = () if keeps_stamps else (Remark("detected", moved),)
    return said + without_frames(part, "Event Stream has none") + without_triggers(part, "Event Stream")


def _through_faery(part: Part, path: Path, kind: Literal["es", "evt"], begins_at_0: bool) -> None:
    import faery  # here, because its import takes a seventh of the viewer's start
    from faery.file_encoder import events_to_file

    sensor = part.recording.sensor
    start = part.first_stamp() if begins_at_0 and part.first_stamp() < 0 else 0
    if kind == "evt" and start < 0:
        raise RecordingError(f"{path.name}: stamps below 0 cannot be written; the format counts from 0")

    def packets() -> Iterator[np.ndarray]:
        for events in part.blocks():
            packet = np.empty(len(events), faery.EVENTS_DTYPE)
            packet["t"], packet["x"], packet["y"], packet["on"] = events.t - start, events.x, events.y, events.p > 0
            yield packet

    events_to_file(
        packets(),
        path,
        (sensor.width, sensor.height),
        version="evt3" if kind == "evt" else None,
        zero_t0=begins_at_0,
        file_type=kind,
        use_write_suffix=False,
    )


def _write_triggers(part: Part, path: Path) -> tuple[Remark, ...]:
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
