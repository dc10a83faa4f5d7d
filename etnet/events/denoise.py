"""Noise tools: a recording without its hot pixels, or without events that nothing near them supports."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int64, UInt32

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.examine import hot_pixels
from etnet.events.pixel_counts import check_countable
from etnet.events.recording import Recording, Remark, Span

MOST_EVENTS = 20_000_000
"""A cleaned recording remembers which events stayed, 4 bytes each: 80 MB at this many."""
_BLOCK = 1 << 18
_LONG_AGO = np.iinfo(np.int64).min // 2


@dataclass(frozen=True, slots=True)
class Cleaning:
    """What is taken out; hashable, so that caches can be keyed by it.

    `support_within` (µs, 0 is off) is the background-activity filter of Delbruck 2008: an event stays if one of its
    eight neighbours fired at most so long before it, whatever the polarity. Hot pixels are taken out first, so that
    they support nothing.
    """

    hot_pixels: bool = False
    support_within: int = 0

    def __post_init__(self) -> None:
        if self.support_within < 0:
            raise ValueError(f"Cleaning: support_within is {self.support_within} µs; wanted at least 0")

    @property
    def changes_nothing(self) -> bool:
        """Whether every event stays."""
        return not (self.hot_pixels or self.support_within)


UNCLEANED = Cleaning()


def cleaned(recording: Recording, cleaning: Cleaning) -> Recording:
    """`recording` with what `cleaning` leaves of it. One pass over all events; a remark says how many stayed."""
    if cleaning.changes_nothing:
        return recording
    if recording.num_events > MOST_EVENTS:
        raise RecordingError(
            f"{recording.name}: {recording.num_events:,} events, noise tools take {MOST_EVENTS:,}; look at a region"
        )
    check_countable(recording)
    kept = np.concatenate([np.empty(0, np.uint32), *_kept(recording, cleaning)])
    if not len(kept):
        raise RecordingError(f"{recording.name}: no event is left after cleaning; filter less")
    source = _KeptSource(recording, kept, recording.sensor)
    first, last = source.read(0, 1).t[0], source.read(len(kept) - 1, len(kept)).t[0]
    remark = Remark("detected", f"cleaned: {len(kept):,} of {recording.num_events:,} events stayed")
    return Recording(
        recording.name,
        recording.format,
        source,
        recording.sensor,
        Span(int(first), int(last)),
        (*recording.remarks, remark),
        recording.ground_truth,
        recording.path,
        recording.inertial,
        recording.triggers,
    )


@dataclass(frozen=True)
class _KeptSource:
    """Some of another recording's events, by their indices there. It holds the recording, which so stays open."""

    inner: Recording
    kept: UInt32[np.ndarray, " n"]
    sensor: Sensor

    @property
    def num_events(self) -> int:
        return len(self.kept)

    def read(self, start: int, stop: int) -> Events:
        if start == stop:
            return Events.empty(self.sensor)
        chosen = self.kept[start:stop].astype(np.int64)
        first = int(chosen[0])
        events, chosen = self.inner.read(first, int(chosen[-1]) + 1), chosen - first
        return Events(events.x[chosen], events.y[chosen], events.t[chosen], events.p[chosen], self.sensor)

    def close(self) -> None:
        """The other recording belongs to the one who opened it."""


def _kept(recording: Recording, cleaning: Cleaning) -> Iterator[UInt32[np.ndarray, " n"]]:
    hot = np.zeros(recording.sensor.num_pixels, bool)
    if cleaning.hot_pixels:
        for pixel in hot_pixels(recording):
            hot[pixel.y * recording.sensor.width + pixel.x] = True
    supports = Support(recording.sensor, cleaning.support_within) if cleaning.support_within else None
    for start in range(0, recording.num_events, _BLOCK):
        events = recording.read(start, min(start + _BLOCK, recording.num_events))
        places = events.y.astype(np.int64) * recording.sensor.width + events.x
        stays = ~hot[places]
        if supports is not None:
            stays[stays] = supports.take(places[stays], events.t[stays])
        yield (np.flatnonzero(stays) + start).astype(np.uint32)


class Support:
    """Which events have a neighbour that fired shortly before; fed in the order of time, block by block."""

    def __init__(self, sensor: Sensor, within: int) -> None:
        self._within = within
        # A frame of one pixel around the sensor, where nothing ever fires, spares every case at the border.
        self._width = sensor.width + 2
        self._sensor_width = sensor.width
        self._newest = np.full(self._width * (sensor.height + 2), _LONG_AGO, np.int64)
        across = np.array([-1, 0, 1])
        self._around = [int(step) for step in (across[:, None] * self._width + across).ravel() if step]

    def take(self, places: Int64[np.ndarray, " n"], t: Int64[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        """Whether each of the next events is supported by those before it."""
        rows, columns = np.divmod(places, self._sensor_width)
        framed = (rows + 1) * self._width + columns + 1
        num = len(framed)
        order = np.arange(num)
        by_place = np.argsort(framed, kind="stable")
        keys = framed[by_place] * num + by_place  # pixel first, then order: ascending
        supported = np.zeros(num, bool)
        for step in self._around:
            neighbour = framed + step
            before = np.searchsorted(keys, neighbour * num + order) - 1
            found = by_place[np.maximum(before, 0)]
            is_there = (before >= 0) & (framed[found] == neighbour)
            fired = np.where(is_there, t[found], self._newest[neighbour])
            supported |= t - fired <= self._within
        # Stamps ascend, so of repeated places the last one, the newest, stays.
        self._newest[framed] = t
        return supported
