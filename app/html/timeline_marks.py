"""What every strip along the timeline needs: its linear axis, what is cached, the event rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float32, Shaped

from app.catalogue.cut import CutRecording
from app.html.moment import ARRAYS, Moment
from etnet.events.recording import Span
from etnet.render.timeline import MICROSECONDS, RateCurve, rate_curve

AXIS_WIDTH = 1000
"""Of the strip's drawing: the recording's first event lies at 0, its last one at the width."""


class Cached(Protocol):
    """What a playback holds, as ranges of window indices."""

    @property
    def frames(self) -> Sequence[range]:
        """Windows whose frame is held."""
        ...

    @property
    def states(self) -> Sequence[range]:
        """Windows whose recurrent state is held: their frames take one decode."""
        ...

    @property
    def is_exact(self) -> bool:
        """Whether the frames are those of a run from the start, unchanged and in this very way of computing."""
        ...


@dataclass(frozen=True, slots=True)
class NothingCached:
    """Before the model has done anything."""

    frames: tuple[range, ...] = ()
    states: tuple[range, ...] = ()
    is_exact: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Hovered:
    """What the pointer is over: a time (s since the first event), its window, and a small frame of it if one is held.

    `key` tells the frame from every other.
    """

    seconds: float
    index: int
    frame: Float32[np.ndarray, "h w"] | None = None
    key: tuple[object, ...] = ()


def place_of(moment: Moment, t: float) -> float:
    """Where a stamp (µs) lies on the strip's linear axis, in its own measure; stamps outside stay at its ends."""
    span = axis_of(moment)
    return AXIS_WIDTH * min(max((t - span.start) / max(span.stop - span.start, 1), 0.0), 1.0)


def places_of(moment: Moment, stamps: Shaped[np.ndarray, " n"]) -> list[float]:
    """The same for many stamps at once."""
    span = axis_of(moment)
    shares = (stamps - float(span.start)) / max(span.stop - span.start, 1)
    return (AXIS_WIDTH * np.clip(shares, 0.0, 1.0)).tolist()


def axis_of(moment: Moment) -> Span:
    """What the strip runs over, µs: the recording, or of a live one what is still held since the network began."""
    recording = moment.recording
    return recording.axis if isinstance(recording, CutRecording) else recording.span


def seconds_of(moment: Moment) -> tuple[float, float]:
    """Where the axis begins and ends, in seconds since the recording's first event."""
    axis, first = axis_of(moment), moment.recording.span.start
    return (axis.start - first) / MICROSECONDS, (axis.stop - first) / MICROSECONDS


def span_of(moment: Moment) -> str:
    """The same, as what is dragged along the axis says them: "0,1.500000"."""
    begin, end = seconds_of(moment)
    return f"{begin:.6f},{end:.6f}" if begin else f"0,{end:.6f}"


def curve_of(moment: Moment) -> RateCurve:
    """The recording's event rate over its windows; sampled once for each plan of windows, which may grow."""
    recording = moment.recording
    if isinstance(recording, CutRecording) and recording.is_live:
        first = recording.first_held
        return ARRAYS.get(
            ("curve", first, *plan_of(moment)), lambda: rate_curve(moment.windows[first:]), lambda made: 4000
        )
    return ARRAYS.get(("curve", *plan_of(moment)), lambda: rate_curve(moment.windows), lambda made: 4000)


def plan_of(moment: Moment) -> tuple[object, ...]:
    """What tells a plan of windows from every other; that of a video gets longer while it is looked at."""
    return moment.recording_id, moment.policy, moment.cleaning, len(moment.windows)
