"""What is written: a part of a recording, the frames and triggers that belong to it, and what is said of the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from etnet.events.assumptions import Progress
from etnet.events.events import Events
from etnet.events.recording import Recording, Remark
from etnet.events.triggers import Triggers

_BLOCK = 1 << 18


@dataclass(frozen=True)
class Part:
    """Events start … stop − 1 of a recording, and how to tell that they are being written.

    `span` (µs, both ends included): the stretch that they stand for, where it is longer than from the first of them to
    the last.
    """

    recording: Recording
    start: int
    stop: int
    progress: Progress
    span: tuple[int, int] | None = None

    @property
    def num_events(self) -> int:
        return self.stop - self.start

    @property
    def is_whole(self) -> bool:
        """Whether nothing of the recording lies outside."""
        return self.span is None and self.num_events == self.recording.num_events

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

    def frames(self) -> range:
        """All of a whole recording; of a part, those from the last one at or before its first event, or `span`, to the
        last one at or before its end."""
        truth = self.recording.ground_truth
        if truth is None:
            return range(0)
        if self.is_whole:
            return range(len(truth))
        first, last = self._stretch()
        begin = max(0, int(np.searchsorted(truth.stamps, first, "right")) - 1)
        return range(begin, max(begin, int(np.searchsorted(truth.stamps, last, "right"))))

    def pictures(self, has_colour: bool) -> Iterator[tuple[int, Shaped[np.ndarray, "h w *c"]]]:
        """Stamp (µs) and numbers of each frame: 8 bits, or 16 of those that were finer.

        Blue, green, red of those that have colours, where the format has them too.
        """
        truth = self.recording.ground_truth
        for index in self.frames():
            assert truth is not None
            self.progress(1.0)  # it can be stopped between frames, too
            white, kind = self.white
            read = truth.read_colour if has_colour and truth.read_colour is not None else truth.read_frame
            yield int(truth.stamps[index]), np.rint(np.clip(read(index), 0, 1) * white).astype(kind)

    @property
    def white(self) -> tuple[int, type[np.unsignedinteger]]:
        """The number that stands for white in the frames that are written, and their type."""
        truth = self.recording.ground_truth
        return (255, np.uint8) if truth is None or truth.white == 255 else (65_535, np.uint16)

    def triggers(self) -> Triggers | None:
        """Those of a whole recording; of a part, those among its events or in its span."""
        triggers = self.recording.triggers
        if triggers is None or self.is_whole:
            return triggers
        first, last = self._stretch()
        kept = slice(*np.searchsorted(triggers.stamps, [first, last + 1]))
        return Triggers(triggers.stamps[kept], triggers.channels[kept], triggers.edges[kept])

    def attributes(self) -> dict[str, str]:
        """How the recording was made, for formats that have a place for it."""
        provenance = self.recording.provenance
        return {} if provenance is None else provenance.as_attributes

    def _stretch(self) -> tuple[int, int]:
        first, last = self.first_stamp(), self.last_stamp()
        return (first, last) if self.span is None else (min(first, self.span[0]), max(last, self.span[1]))


Writer = Callable[[Part, Path], tuple[Remark, ...]]
"""Writes a part to a file, or into an empty folder, and says what that cannot hold."""


def without_frames(part: Part, why: str) -> tuple[Remark, ...]:
    """That the frames were left out."""
    if part.recording.ground_truth is None:
        return ()
    return (Remark("detected", f"the camera's frames were not written: {why}"),)


def without_colour(part: Part, why: str) -> tuple[Remark, ...]:
    """That frames in colour were written in grey."""
    truth = part.recording.ground_truth
    if truth is None or truth.read_colour is None or not part.frames():
        return ()
    return (Remark("detected", f"the camera's frames were written in grey: {why}"),)


def without_flow(part: Part) -> tuple[Remark, ...]:
    """That the optical flow was left out."""
    truth = part.recording.ground_truth
    if truth is None or truth.read_flow is None or not part.frames():
        return ()
    return (Remark("detected", "the optical flow was not written: event_utils HDF5 has a place for it"),)


def without_triggers(part: Part, what: str) -> tuple[Remark, ...]:
    """That the triggers were left out."""
    triggers = part.recording.triggers
    if triggers is None:
        return ()
    has = "EVT3, AEDAT4 and HDF5 have"
    return (Remark("detected", f"{len(triggers)} triggers were not written: {what} has no place for them, {has}"),)


def without_size(part: Part, what: str) -> Remark:
    """That a file does not tell the sensor's size, and how to open it all the same."""
    sensor = part.recording.sensor
    size = f"open it with --assume width={sensor.width},height={sensor.height}"
    return Remark("detected", f"the sensor's size, {sensor}, was not written: {what} has no place for it; {size}")
