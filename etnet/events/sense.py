"""Whether what was opened makes sense: a clock that a camera could have, and frames that belong to the events.

Said for every format alike, as advice; nothing is changed by it.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.recording import EventSource, GroundTruth, Remark, Span

LONGEST = 86_400 * 10**6
"""µs that a recording may last before it is doubted: a day."""

LEAST_RATE = 1e-3
"""Events per pixel and second; noise alone gives more."""

MOST_EVENTS = 2e9
"""Events a second that any readout gives at most."""

FRAMES_BESIDE = 100_000
"""µs that frames may lie beyond the events: cameras start and stop one after the other."""

_ENOUGH = 100
_SLICES, _SLICE = 4, 4096
_COARSE_STEP = 1000
"""µs between stamps from which on a clock is called coarse, if events share its stamps."""
_EVENTS_A_STAMP = 20
_SHARE_A_STAMP = 0.02
"""Of the sensor's pixels that fire at one stamp, on average, from which on it is called coarse whatever its steps."""


def advice_on_clock(source: EventSource, sensor: Sensor, span: Span) -> tuple[str, ...]:
    """What is odd about the time of the events."""
    count, seconds = source.num_events, span.duration / 1e6
    if count < 2:
        return ()
    if span.duration == 0:
        return (
            f"all {count:,} events have one timestamp, {span.start} µs: the time was lost when they were saved, or "
            "another column is the time",
        )
    rate = count / seconds
    said = []
    if span.duration > LONGEST or (count >= _ENOUGH and rate / sensor.num_pixels < LEAST_RATE):
        said.append(
            f"it lasts {_lasts(seconds)} with {rate:,.3g} events a second, which no camera gives: is the unit of the "
            "stamps right? --time-unit s, ms, us or ns states it"
        )
    if count >= _ENOUGH and rate > MOST_EVENTS:
        said.append(
            f"{count:,} events in {seconds:.3g} s are {rate:,.3g} a second, more than any camera reads out: is the "
            "unit of the stamps right? --time-unit s, ms, us or ns states it"
        )
    return (*said, *_advice_on_steps(source, sensor))


def _lasts(seconds: float) -> str:
    return f"{seconds / 86_400:,.1f} days" if seconds > 2 * 86_400 else f"{seconds:,.0f} s"


def _advice_on_steps(source: EventSource, sensor: Sensor) -> tuple[str, ...]:
    """Few stamps for many events: a clock that ticks too slowly for windows of few events."""
    num_events = num_stamps = 0
    smallest: int | None = None
    starts = np.linspace(0, max(0, source.num_events - _SLICE), _SLICES).astype(int)
    with suppress(RecordingError):
        for start in sorted(set(starts.tolist())):
            t = source.read(start, min(start + _SLICE, source.num_events)).t
            steps = np.diff(t)
            steps = steps[steps > 0]
            num_events, num_stamps = num_events + len(t), num_stamps + len(steps) + 1
            if len(steps):
                smallest = int(steps.min()) if smallest is None else min(smallest, int(steps.min()))
    if smallest is None or num_events < max(10, num_stamps) * _EVENTS_A_STAMP:
        return ()
    if smallest < _COARSE_STEP and num_events < _SHARE_A_STAMP * sensor.num_pixels * num_stamps:
        return ()
    return (
        f"about {num_events // num_stamps:,} events share a stamp, and stamps lie {smallest:,} µs apart at least: the "
        "clock is coarse, or rows were read at once; windows cannot be finer than that",
    )


def advice_on_frames(truth: GroundTruth | None, sensor: Sensor, span: Span) -> tuple[str, ...]:
    """Frames on another clock, or of another size than the sensor's."""
    if truth is None or len(truth) == 0:
        return ()
    said = []
    stamps = truth.stamps
    is_beside = (stamps >= span.start - FRAMES_BESIDE) & (stamps <= span.stop + FRAMES_BESIDE)
    num_outside = int(np.count_nonzero(~is_beside))
    if num_outside > max(1, len(stamps) // 2) or num_outside == len(stamps):
        said.append(
            f"{num_outside} of {len(stamps)} frames lie outside the events' time (frames {int(stamps[0])} … "
            f"{int(stamps[-1])} µs, events {span.start} … {span.stop} µs): the two clocks differ, so between most "
            "frames there are no events"
        )
    with suppress(RecordingError):
        height, width = truth.read_frame(0).shape
        if (width, height) != (sensor.width, sensor.height):
            said.append(
                f"the frames have {width}×{height} pixels, the sensor {sensor}: they are another camera's, or were "
                "scaled, and cannot be compared pixel by pixel"
            )
    return tuple(said)


def advice_on(source: EventSource, sensor: Sensor, span: Span, truth: GroundTruth | None) -> tuple[Remark, ...]:
    """All of it, as remarks."""
    said = (*advice_on_clock(source, sensor, span), *advice_on_frames(truth, sensor, span))
    return tuple(Remark("advice", text) for text in said)
