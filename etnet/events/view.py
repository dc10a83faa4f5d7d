"""What is looked at of a recording: a region, every 2nd or 4th pixel, mirrored or turned; applied while reading.

The order is region, binning, flip, rotation. Binning adds up: each event moves to its coarser pixel, none is lost.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np
from jaxtyping import Float32, Int64, UInt16

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.formats.base import Opened, Remarks, Request
from etnet.events.opened_as import WHOLE_VIEW, View
from etnet.events.recording import Bracketing, EventSource, GroundTruth, Recording, Span

REGION_BLOCK = 65_536
"""Events of the file between two entries of a region's index."""

_HELD_BLOCKS = 16


@dataclass(frozen=True)
class _Placement:
    """From a pixel of the sensor (inside the region) to a pixel of the view."""

    view: View
    region: tuple[int, int, int, int]

    @property
    def sensor(self) -> Sensor:
        """The view's size."""
        width, height = (-(-side // self.view.downsample) for side in self.region[2:])
        return Sensor(height, width) if self.view.rotate in (90, 270) else Sensor(width, height)

    def place(
        self, x: UInt16[np.ndarray, " n"], y: UInt16[np.ndarray, " n"]
    ) -> tuple[UInt16[np.ndarray, " n"], UInt16[np.ndarray, " n"]]:
        """Both columns, moved."""
        left, top, width, height = self.region
        factor = self.view.downsample
        across, down = (x - np.uint16(left)) // np.uint16(factor), (y - np.uint16(top)) // np.uint16(factor)
        right, bottom = np.uint16(-(-width // factor) - 1), np.uint16(-(-height // factor) - 1)
        if self.view.flip in ("horizontal", "both"):
            across = right - across
        if self.view.flip in ("vertical", "both"):
            down = bottom - down
        if self.view.rotate == 90:
            return bottom - down, across
        if self.view.rotate == 180:
            return right - across, bottom - down
        if self.view.rotate == 270:
            return down, right - across
        return across, down

    def truth(self, truth: GroundTruth) -> GroundTruth:
        """A camera's pictures in the same way, in colour where they are."""
        read_colour = truth.read_colour
        # Flow vectors would have to turn and shrink with the pixels; no protocol evaluates a changed view.
        return GroundTruth(
            truth.stamps,
            lambda i: self.frame(truth.read_frame(i)),
            white=truth.white,
            read_colour=None if read_colour is None else lambda i: self.colour(read_colour(i)),
        )

    def colour(self, picture: Float32[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "a b 3"]:
        """A picture with colours: each of them by itself."""
        return np.stack([self.frame(picture[..., channel]) for channel in range(3)], 2)

    def frame(self, frame: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "a b"]:
        """A camera's picture in the same way; binning is the mean, with the edge repeated where a block is cut."""
        left, top, width, height = self.region
        part = frame[top : top + height, left : left + width]
        factor = self.view.downsample
        if factor > 1:
            part = np.pad(part, ((0, -height % factor), (0, -width % factor)), "edge")
            rows, columns = part.shape[0] // factor, part.shape[1] // factor
            part = part.reshape(rows, factor, columns, factor).mean((1, 3), dtype=np.float32)
        if self.view.flip in ("horizontal", "both"):
            part = part[:, ::-1]
        if self.view.flip in ("vertical", "both"):
            part = part[::-1]
        return np.ascontiguousarray(np.rot90(part, -self.view.rotate // 90))


@dataclass(frozen=True)
class _PlacedSource:
    """Events at other pixels; indices stay as they are."""

    inner: EventSource
    placement: _Placement

    @property
    def num_events(self) -> int:
        return self.inner.num_events

    def read(self, start: int, stop: int) -> Events:
        events = self.inner.read(start, stop)
        x, y = self.placement.place(events.x, events.y)
        return Events(x, y, events.t, events.p, self.placement.sensor)

    def bracket(self, t: int) -> tuple[int, int] | None:
        return self.inner.bracket(t) if isinstance(self.inner, Bracketing) else None

    def close(self) -> None:
        self.inner.close()


@dataclass(frozen=True)
class _RegionSource:
    """Events of a region only. `before[i]` counts those in the file's first i blocks, so a slice is found at once."""

    inner: EventSource
    region: tuple[int, int, int, int]
    before: Int64[np.ndarray, " blocks"]
    sensor: Sensor
    _held: OrderedDict[int, Events] = field(default_factory=OrderedDict)
    _lock: Lock = field(default_factory=Lock)

    @property
    def num_events(self) -> int:
        return int(self.before[-1])

    def read(self, start: int, stop: int) -> Events:
        if start == stop:
            return Events.empty(self.sensor)
        first = int(np.searchsorted(self.before, start, "right")) - 1
        last = int(np.searchsorted(self.before, stop, "left")) - 1
        parts = [self._block(i) for i in range(first, last + 1)]
        offset = int(self.before[first])
        return Events.concatenate(parts, self.sensor)[start - offset : stop - offset]

    def close(self) -> None:
        self.inner.close()

    def _block(self, i: int) -> Events:
        with self._lock:
            if i in self._held:
                self._held.move_to_end(i)
                return self._held[i]
        kept = _inside(self.inner, i, self.region)
        with self._lock:
            self._held[i] = kept
            while len(self._held) > _HELD_BLOCKS:
                self._held.popitem(last=False)
        return kept


def _inside(source: EventSource, i: int, region: tuple[int, int, int, int]) -> Events:
    events = source.read(i * REGION_BLOCK, min((i + 1) * REGION_BLOCK, source.num_events))
    left, top, width, height = region
    inside = (events.x >= left) & (events.x < left + width) & (events.y >= top) & (events.y < top + height)
    return Events(events.x[inside], events.y[inside], events.t[inside], events.p[inside], events.sensor)


def seen_through(view: View, opened: Opened, request: Request) -> Opened:
    """`opened` as the view shows it. A region needs one pass over the file, which makes its index."""
    if view == WHOLE_VIEW:
        return opened
    remarks = Remarks(list(opened.remarks))
    region = view.region or (0, 0, opened.sensor.width, opened.sensor.height)
    if region[0] + region[2] > opened.sensor.width or region[1] + region[3] > opened.sensor.height:
        raise RecordingError(f"{request.name}: the region {region} reaches beyond its sensor {opened.sensor}")
    source, span = opened.source, opened.span
    if view.region is not None:
        source, span = _cut(opened, region, request)
        remarks.detected(
            f"shown is the region x {region[0]}, y {region[1]}, {region[2]}×{region[3]} of {opened.sensor}"
        )
    placement = _Placement(view, region)
    if view.downsample > 1:
        remarks.detected(f"{view.downsample}×{view.downsample} pixels are joined to one; no event is lost")
    if view.flip != "none" or view.rotate:
        remarks.detected(f"flipped: {view.flip}; rotated clockwise by {view.rotate}°")
    truth = _placed_truth(opened, placement, remarks)
    return replace(
        opened,
        source=_PlacedSource(source, placement),
        sensor=placement.sensor,
        span=span,
        remarks=tuple(remarks.kept),
        ground_truth=truth,
    )


def seen_whole(view: View, recording: Recording) -> Recording:
    """`recording` as a view without a region shows it: no pass over its events, so it may still be growing."""
    if view.region is not None:
        raise RecordingError(f"{recording.name}: a region needs a whole recording; open the file with it")
    placement = _Placement(view, (0, 0, recording.sensor.width, recording.sensor.height))
    truth = None if recording.ground_truth is None else placement.truth(recording.ground_truth)
    source = _PlacedSource(recording.source, placement)
    return replace(recording, source=source, sensor=placement.sensor, ground_truth=truth)


def _cut(opened: Opened, region: tuple[int, int, int, int], request: Request) -> tuple[EventSource, Span]:
    num_blocks = -(-opened.source.num_events // REGION_BLOCK)
    before = np.zeros(num_blocks + 1, np.int64)
    first, last = None, None
    for i in range(num_blocks):
        kept = _inside(opened.source, i, region)
        before[i + 1] = before[i] + len(kept)
        if len(kept):
            first, last = int(kept.t[0]) if first is None else first, int(kept.t[-1])
        request.progress((i + 1) / num_blocks)
    if first is None or last is None:
        raise RecordingError(f"{request.name}: no event lies in the region {region}; choose another one")
    return _RegionSource(opened.source, region, before, opened.sensor), Span(first, last)


def _placed_truth(opened: Opened, placement: _Placement, remarks: Remarks) -> GroundTruth | None:
    truth = opened.ground_truth
    if truth is None:
        return None
    if truth.read_frame(0).shape != (opened.sensor.height, opened.sensor.width):
        remarks.detected("the camera's frames have another size than the sensor and are not shown in this view")
        return None
    return placement.truth(truth)
