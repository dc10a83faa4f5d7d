"""The doctor: look a recording through once and say what it is, what is odd in it, and which window would suit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from jaxtyping import Int64

from etnet.events.assumptions import Progress
from etnet.events.events import Events
from etnet.events.pixel_counts import LARGEST_COUNTED, HotPixel, PixelCounts, outstanding
from etnet.events.recording import Recording
from etnet.events.sense import advice_on_frames

RATE_BINS = 200
"""Points of the rate curve."""

LARGEST_LOOK = 20_000_000
"""Events looked at one by one; of a longer recording, blocks spread evenly over it."""

SUGGESTED_DENSITY = 0.35
"""Events per pixel of the suggested window: rpg_e2vid's default."""

_BLOCK = 1 << 18
_LOOKS_AT_ONCE = 10
_MOST_NAMED = 20
_STEP_EDGES = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1_000, 10_000, 100_000, 1_000_000)
_GAP_FACTOR = 1000
_SHORTEST_GAP = 10_000


@dataclass(frozen=True, slots=True)
class Gap:
    """A stretch without any event, µs."""

    start: int
    stop: int


@dataclass(frozen=True, slots=True)
class FramesExam:
    """The ordinary camera's frames against the events' clock; times in µs."""

    num_frames: int
    width: int
    height: int
    first: int
    last: int
    frames_per_second: float
    first_after_first_event: int
    num_outside_span: int


@dataclass(frozen=True, slots=True)
class TriggersExam:
    """The edges on the camera's trigger inputs; times in µs. What is neither rising nor falling has no known edge."""

    num_triggers: int
    num_rising: int
    num_falling: int
    channels: tuple[int, ...]
    first: int
    last: int
    num_outside_span: int


@dataclass(frozen=True, slots=True)
class Examination:
    """What was found. `as_dict` is ready for JSON. All times in µs, rates in events per second.

    `rates` has one value for each of `RATE_BINS` equal parts of the span. `step_counts[i]` counts steps between
    neighbouring events of `step_edges[i]` … `step_edges[i + 1]` µs (the last one upwards). `count_image` is events per
    pixel of those that were looked at; of a sensor that is too large for that, per cell of `cell` × `cell` pixels, and
    then silent and hot pixels are not known.
    """

    name: str
    format: str
    width: int
    height: int
    start: int
    stop: int
    num_events: int
    num_looked_at: int
    num_on: int
    mean_rate: float
    peak_rate: float
    rates: tuple[float, ...]
    gaps: tuple[Gap, ...]
    num_equal_stamps: int
    longest_equal_run: int
    num_repeated_events: int
    step_edges: tuple[int, ...]
    step_counts: tuple[int, ...]
    cell: int
    num_silent_pixels: int | None
    hot_pixels: tuple[HotPixel, ...]
    frames: FramesExam | None
    triggers: TriggersExam | None
    suggested_events: int
    suggested_duration: int
    remarks: tuple[str, ...]
    advice: tuple[str, ...]
    count_image: Int64[np.ndarray, "h w"] = field(repr=False, compare=False)

    def as_dict(self) -> dict[str, Any]:
        """Everything but the picture, in types that JSON knows."""
        return {part.name: _plain(getattr(self, part.name)) for part in fields(self) if part.name != "count_image"}


@dataclass
class _Tally:
    """What one pass counts."""

    counts: PixelCounts
    steps: Int64[np.ndarray, " bins"] = field(default_factory=lambda: np.zeros(len(_STEP_EDGES), np.int64))
    num_on: int = 0
    num_looked_at: int = 0
    num_equal: int = 0
    num_repeated: int = 0
    longest_run: int = 0
    wide_steps: list[Gap] = field(default_factory=list)

    def look(self, events: Events, shortest_gap: int) -> None:
        """Take in one block; steps between blocks are not counted."""
        if len(events) == 0:
            return
        self.counts.add(events)
        self.num_on += int(np.count_nonzero(events.p > 0))
        self.num_looked_at += len(events)
        steps = np.diff(events.t)
        self.steps += np.bincount(np.searchsorted(_STEP_EDGES, steps, "right") - 1, minlength=len(self.steps))
        is_equal = steps == 0
        places = events.y.astype(np.int64) * events.sensor.width + events.x
        self.num_equal += int(np.count_nonzero(is_equal))
        same = is_equal & (np.diff(places) == 0) & (events.p[1:] == events.p[:-1])
        self.num_repeated += int(np.count_nonzero(same))
        borders = np.concatenate([[0], np.flatnonzero(~is_equal) + 1, [len(events)]])
        self.longest_run = max(self.longest_run, int(np.diff(borders).max()))
        for i in np.flatnonzero(steps >= shortest_gap)[: _MOST_NAMED * 10].tolist():
            self.wide_steps.append(Gap(int(events.t[i]), int(events.t[i + 1])))


def examine(recording: Recording, progress: Progress | None = None) -> Examination:
    """Look the recording through. `progress` is told the fraction done."""
    for found, share in look_through(recording):
        if progress is not None:
            progress(share)
        if found is not None:
            return found
    raise AssertionError("the last of its findings is whole")


def look_through(recording: Recording) -> Iterator[tuple[Examination | None, float]]:
    """`examine` in short stretches: `None` and the share done after each block, at last all that was found."""
    indices: list[int] = []
    for index in _borders(recording):
        indices.append(index)
        if len(indices) % _LOOKS_AT_ONCE == 0:
            yield None, 0.0
    shortest_gap = max(_SHORTEST_GAP, int(_GAP_FACTOR * 1e6 / max(_mean_rate(recording), 1e-9)))
    tally = _Tally(PixelCounts(recording.sensor))
    for fraction, events in _blocks(recording):
        tally.look(events, shortest_gap)
        yield None, min(fraction, 0.99)
    yield _findings(recording, _rates(recording, indices), tally), 1.0


def _findings(recording: Recording, rates: tuple[float, ...], tally: _Tally) -> Examination:
    mean_rate = _mean_rate(recording)
    image, is_each_pixel = tally.counts.image, tally.counts.cell == 1
    suggested = min(max(1, round(SUGGESTED_DENSITY * recording.sensor.num_pixels)), max(1, recording.num_events))
    hot = outstanding(image) if is_each_pixel else ()
    frames = _frames(recording)
    gaps = tuple(sorted(tally.wide_steps, key=lambda gap: gap.start - gap.stop)[:_MOST_NAMED])
    return Examination(
        name=recording.name,
        format=recording.format,
        width=recording.sensor.width,
        height=recording.sensor.height,
        start=recording.span.start,
        stop=recording.span.stop,
        num_events=recording.num_events,
        num_looked_at=tally.num_looked_at,
        num_on=tally.num_on,
        mean_rate=mean_rate,
        peak_rate=max(rates, default=0.0),
        rates=rates,
        gaps=gaps,
        num_equal_stamps=tally.num_equal,
        longest_equal_run=tally.longest_run,
        num_repeated_events=tally.num_repeated,
        step_edges=_STEP_EDGES,
        step_counts=tuple(tally.steps.tolist()),
        cell=tally.counts.cell,
        num_silent_pixels=int(np.count_nonzero(image == 0)) if is_each_pixel else None,
        hot_pixels=hot[:_MOST_NAMED],
        frames=frames,
        triggers=_triggers(recording),
        suggested_events=suggested,
        suggested_duration=round(suggested * 1e6 / mean_rate) if mean_rate else 0,
        remarks=tuple(str(remark) for remark in recording.remarks),
        advice=_advice(recording, tally, hot),
        count_image=image,
    )


def _mean_rate(recording: Recording) -> float:
    """Events per second; 0 where all have one timestamp, for then there is no rate."""
    return recording.num_events * 1e6 / recording.span.duration if recording.span.duration else 0.0


def _borders(recording: Recording) -> Iterator[int]:
    """The first event of each of equal parts of the span, from the time index alone."""
    if recording.num_events == 0 or recording.span.duration == 0:
        return
    start, duration = recording.span.start, recording.span.duration
    num_bins = min(RATE_BINS, duration)
    # Whole numbers: an epoch stamp in µs has no digits to spare in a float.
    for i in range(num_bins):
        yield recording.index_at(start - (-duration * i // num_bins))


def _rates(recording: Recording, borders: list[int]) -> tuple[float, ...]:
    """Events per second in the parts that begin at these events."""
    if not borders:
        return ()
    per_second = 1e6 * len(borders) / recording.span.duration
    return tuple((np.diff([*borders, recording.num_events]) * per_second).tolist())


def _blocks(recording: Recording) -> Iterator[tuple[float, Events]]:
    num_blocks = -(-recording.num_events // _BLOCK)
    every = max(1, -(-recording.num_events // LARGEST_LOOK))
    for i in range(0, num_blocks, every):
        yield (i + 1) / num_blocks, recording.read(i * _BLOCK, min((i + 1) * _BLOCK, recording.num_events))


def hot_pixels(recording: Recording) -> tuple[HotPixel, ...]:
    """All hot pixels of a recording whose pixels can be counted one by one (`check_countable`), the worst first."""
    counts = PixelCounts(recording.sensor)
    for _, events in _blocks(recording):
        counts.add(events)
    return outstanding(counts.image)


def _frames(recording: Recording) -> FramesExam | None:
    truth = recording.ground_truth
    if truth is None or len(truth) == 0:
        return None
    height, width = truth.read_frame(0).shape
    stamps = truth.stamps
    lasts = max(1, int(stamps[-1] - stamps[0]))
    return FramesExam(
        num_frames=len(truth),
        width=int(width),
        height=int(height),
        first=int(stamps[0]),
        last=int(stamps[-1]),
        frames_per_second=(len(truth) - 1) * 1e6 / lasts if len(truth) > 1 else 0.0,
        first_after_first_event=int(stamps[0]) - recording.span.start,
        num_outside_span=int(np.count_nonzero((stamps < recording.span.start) | (stamps > recording.span.stop))),
    )


def _triggers(recording: Recording) -> TriggersExam | None:
    triggers = recording.triggers
    if triggers is None or len(triggers) == 0:
        return None
    stamps = triggers.stamps
    return TriggersExam(
        num_triggers=len(triggers),
        num_rising=int(np.count_nonzero(triggers.edges > 0)),
        num_falling=int(np.count_nonzero(triggers.edges < 0)),
        channels=tuple(np.unique(triggers.channels).tolist()),
        first=int(stamps[0]),
        last=int(stamps[-1]),
        num_outside_span=int(np.count_nonzero((stamps < recording.span.start) | (stamps > recording.span.stop))),
    )


def _advice(recording: Recording, tally: _Tally, hot: tuple[HotPixel, ...]) -> tuple[str, ...]:
    """What a person should know before trusting a picture made of these events; what was said on opening first."""
    said = [remark.text for remark in recording.remarks if remark.kind == "advice"]
    looked = max(1, tally.num_looked_at)
    if tally.num_looked_at == 0:
        return ("there are no events to look at",)
    if tally.counts.cell > 1:
        said.append(
            f"a sensor of {recording.sensor} has more than {LARGEST_COUNTED:,} pixels: events were counted in cells of "
            f"{tally.counts.cell}×{tally.counts.cell}, silent and hot pixels were not; is the size right?"
        )
    if not 0.1 <= tally.num_on / looked <= 0.9:
        said.append(
            f"{tally.num_on / looked:.0%} of the events are ON: check the polarity coding or the camera's biases"
        )
    if hot:
        share = sum(pixel.num_events for pixel in hot) / looked
        make = "1 hot pixel makes" if len(hot) == 1 else f"{len(hot)} hot pixels make"
        said.append(f"{make} {share:.1%} of the events; a hot-pixel mask would help")
    if recording.span.duration and tally.longest_run > 0.05 * recording.sensor.num_pixels:
        most = f"up to {tally.longest_run} events share one timestamp"
        said.append(f"{most}: the clock is coarse or rows are read at once")
    if recording.path is None:  # nothing was opened, so nobody looked at its frames yet
        said += advice_on_frames(recording.ground_truth, recording.sensor, recording.span)
    return tuple(said)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, (Gap, HotPixel, FramesExam, TriggersExam)):
        return {part.name: _plain(getattr(value, part.name)) for part in fields(value)}
    return value
