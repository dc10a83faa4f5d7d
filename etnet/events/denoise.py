"""Noise tools: a recording without its hot pixels, or without events that nothing near them supports."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Int64, UInt32

from etnet.errors import RecordingError
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.events import Events, Sensor
from etnet.events.examine import hot_pixels
from etnet.events.pixel_counts import check_countable
from etnet.events.recording import Recording, Remark, Span

__all__ = ["MOST_EVENTS", "UNCLEANED", "Cleaning", "Support", "cleaned", "num_masked", "removed_share", "uncleaned"]

MOST_EVENTS = 20_000_000
"""A cleaned recording remembers which events stayed, 4 bytes each: 80 MB at this many."""
_BLOCK = 1 << 18
_LONG_AGO = np.iinfo(np.int64).min // 2


def cleaned(recording: Recording, cleaning: Cleaning, *, closes: bool = False) -> Recording:
    """`recording` with what `cleaning` leaves of it. One pass over all events; a remark says how many stayed.

    `closes`: closing the result closes `recording`, too.
    """
    if cleaning.changes_nothing:
        return recording
    if recording.num_events > MOST_EVENTS:
        raise RecordingError(
            f"{recording.name}: {recording.num_events:,} events, noise tools take {MOST_EVENTS:,}; look at a region"
        )
    if recording.growth is not None or recording.latest is not None:
        raise RecordingError(f"{recording.name}: more of it is still being made; filter it when all of it is there")
    check_countable(recording)
    hot = _hot_mask(recording, cleaning)
    kept = np.concatenate([np.empty(0, np.uint32), *_kept(recording, cleaning, hot)])
    if not len(kept):
        raise RecordingError(f"{recording.name}: no event is left after cleaning; filter less")
    source = _KeptSource(recording, kept, recording.sensor, closes, int(hot.sum()))
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
        None if recording.opened_as is None else replace(recording.opened_as, cleaning=cleaning),
        provenance=recording.provenance,
    )


def uncleaned(recording: Recording) -> Recording:
    """The recording that `cleaned` made this one of; itself where it is none of those."""
    return recording.source.inner if isinstance(recording.source, _KeptSource) else recording


def num_masked(recording: Recording) -> int:
    """The number of hot pixels that `cleaned` took out."""
    return recording.source.num_masked if isinstance(recording.source, _KeptSource) else 0


def removed_share(recording: Recording) -> float:
    """The share of events that `cleaned` took out, 0 … 1; 0 where it was not filtered."""
    return 1.0 - recording.num_events / max(uncleaned(recording).num_events, 1)


@dataclass(frozen=True)
class _KeptSource:
    """Some of another recording's events, by their indices there. It holds the recording, which so stays open."""

    inner: Recording
    kept: UInt32[np.ndarray, " n"]
    sensor: Sensor
    closes: bool = False
    num_masked: int = 0

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
        """The other recording belongs to the one who opened it, unless it was handed over."""
        if self.closes:
            self.inner.close()


def _hot_mask(recording: Recording, cleaning: Cleaning) -> Bool[np.ndarray, " pixels"]:
    hot = np.zeros(recording.sensor.num_pixels, bool)
    if cleaning.hot_pixels:
        for pixel in hot_pixels(recording):
            hot[pixel.y * recording.sensor.width + pixel.x] = True
    return hot


def _kept(
    recording: Recording, cleaning: Cleaning, hot: Bool[np.ndarray, " pixels"]
) -> Iterator[UInt32[np.ndarray, " n"]]:
    within, neighbours = cleaning.support_within, cleaning.neighbours
    supports = Support(recording.sensor, within, neighbours) if cleaning.support_within else None
    for start in range(0, recording.num_events, _BLOCK):
        events = recording.read(start, min(start + _BLOCK, recording.num_events))
        places = events.y.astype(np.int64) * recording.sensor.width + events.x
        stays = ~hot[places]
        if supports is not None:
            stays[stays] = supports.take(places[stays], events.t[stays])
        yield (np.flatnonzero(stays) + start).astype(np.uint32)


class Support:
    """Which events have enough neighbours that fired shortly before; fed in the order of time, block by block."""

    def __init__(self, sensor: Sensor, within: int, neighbours: int = 1) -> None:
        self._within = within
        self._neighbours = neighbours
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
        supporters = np.zeros(num, np.uint8)
        for step in self._around:
            neighbour = framed + step
            before = np.searchsorted(keys, neighbour * num + order) - 1
            found = by_place[np.maximum(before, 0)]
            is_there = (before >= 0) & (framed[found] == neighbour)
            fired = np.where(is_there, t[found], self._newest[neighbour])
            supporters += t - fired <= self._within
        # Stamps ascend, so of repeated places the last one, the newest, stays.
        self._newest[framed] = t
        return supporters >= self._neighbours
