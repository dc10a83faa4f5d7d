"""Frames with stamps go in one by one, events come out: for files, growing videos, a webcam and arrays alike."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, ParamSpec, TypeVar

import cv2
import numpy as np
from jaxtyping import Float32

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.simulation.footage import Frame
from etnet.simulation.motion import (
    SMALLEST_SIDE,
    Between,
    Guide,
    Level,
    Moving,
    Straight,
    flow_between,
    guide_of,
    is_cut,
    motion_between,
)  # fmt: skip
from etnet.simulation.noise import Noise
from etnet.simulation.sensor import Crossings, PixelArray, SensorTraits, events_of

MOST_STEPS = 32
"""Steps between two frames, at most: what is faster than so many pixels a frame is stepped over coarsely."""
_AHEAD = 2
"""Levels that are prepared while the sensor looks at one; frame pairs whose flow is looked for meanwhile."""

P = ParamSpec("P")
T = TypeVar("T")
Interpolate = Literal["auto", "off"] | int
Learned = Callable[[Level, Level, float], Level]
"""A learned interpolator: two log images and a share of the way give the log image there."""


@dataclass(frozen=True, slots=True)
class Stepping:
    """How finely the way from one frame to the next is gone.

    "auto" takes as many steps as keep motion at one pixel and a pixel's events at one, for 99 % of the picture and up
    to `most_steps`; a number takes so many along the flow; "off" runs straight from frame to frame.
    """

    interpolate: Interpolate = "auto"
    most_steps: int = MOST_STEPS
    finds_cuts: bool = True
    learned: Learned | None = None

    def __post_init__(self) -> None:
        if isinstance(self.interpolate, int) and not 1 <= self.interpolate <= 1000:
            raise RecordingError(f"interpolate is {self.interpolate}; it takes auto, off, or 1 to 1000 steps a frame")

    def count(self, between: Between, change: float, threshold: float) -> int:
        """Steps for this pair; `change` is the log change that 99 % of the pixels stay below."""
        if self.interpolate == "off":
            return 1
        if isinstance(self.interpolate, int):
            return self.interpolate
        return min(max(1, math.ceil(between.motion), math.ceil(change / threshold)), self.most_steps)


@dataclass(frozen=True, eq=False, slots=True)
class _Look:
    """A frame as the pixels and the search for motion want it."""

    frame: Frame
    level: Level
    guide: Guide


@dataclass(eq=False, slots=True)
class Account:
    """What a simulation met by now. Lists are short: one entry a cut."""

    num_frames: int = 0
    num_events: int = 0
    num_steps: int = 0
    failed: float = 0.0
    """Sum over frames of the share of the picture in which no motion was found."""
    largest_change: float = 0.0
    """Of log intensity between two frames, over all pixels."""
    cuts: deque[float] = None  # pyright: ignore[reportAssignmentType]
    """µs at which a new scene begins; the latest hundred."""
    num_cuts: int = 0

    def __post_init__(self) -> None:
        self.cuts = deque(maxlen=100)

    def sentences(self, threshold: float) -> list[str]:
        """What should be said of it."""
        said, pairs = [], max(self.num_frames - 1, 1)
        if self.num_cuts:
            places = ", ".join(f"{t / 1e6:.2f}" for t in list(self.cuts)[:5])
            more = " …" if self.num_cuts > 5 else ""
            said.append(f"{self.num_cuts} cuts, at {places}{more} s: the sensor starts again at each")
        if self.failed / pairs > 0.005:
            said.append(f"no motion was found in {self.failed / pairs:.1%} of the picture: straight lines there")
        if self.num_events == 0:
            said.append(
                f"0 events: log intensity changes by {self.largest_change:.3f} at most from frame to frame, an event "
                f"takes {threshold:g}; lower the thresholds, or check that something moves"
            )
        return said


class EventSimulator:
    """A modelled sensor that frames are shown to. It keeps one frame, whatever the length; `close` ends its threads.

    Events are those of ESIM (Rebecq et al. 2018) with v2e's imperfections. The same frames, settings and seed give the
    same events, bit for bit, for any `threads`.
    """

    def __init__(
        self,
        traits: SensorTraits,
        stepping: Stepping | None = None,
        seed: int = 0,
        threads: int = 2,
        exposure_us: float = 0.0,
    ) -> None:
        self.traits, self.stepping, self.account = traits, stepping or Stepping(), Account()
        self.camera: Float32[np.ndarray, "h w"] | None = None
        """Light that an ordinary camera with `exposure_us` collected up to the newest frame."""
        self._rng, self._exposure_us = np.random.default_rng(seed), exposure_us
        self._pool = ThreadPoolExecutor(threads, "simulation") if threads > 1 else None
        self._pixels: PixelArray | None = None
        self._noise: Noise | None = None
        self._sensor: Sensor | None = None
        self._before: _Look | None = None
        self._held: list[Crossings] = []
        self._between: Between | None = None

    @property
    def flow(self) -> Float32[np.ndarray, "2 h w"] | None:
        """How far the point that each pixel of the newest frame shows has come since the frame before, x and y in
        pixels; None where no flow was looked for."""
        if not isinstance(self._between, Moving):
            return None
        return -np.moveaxis(self._between.backward.flow, 2, 0)

    def feed(self, light: Float32[np.ndarray, "h w"], t: float, is_cut: bool = False) -> Events:
        """Show the next frame (linear light, 1 is white; `t` in µs, ascending): the events since the one before."""
        look = self._look(Frame(t, light, is_cut=is_cut))
        pair = None if self._before is None else self._pair(self._before, look)
        return self._advance(look, pair)

    def run(self, frames: Iterable[Frame]) -> Iterator[tuple[Frame, Events]]:
        """All frames in turn, each with the events since the one before; flow is looked for a little ahead."""
        ahead: deque[tuple[_Look, Callable[[], Between] | None]] = deque()
        last = self._before
        for frame in frames:
            look = self._look(frame)
            ahead.append((look, None if last is None else self._pair(last, look)))
            last = look
            if len(ahead) > (_AHEAD if self._pool else 0):
                look, pair = ahead.popleft()
                yield look.frame, self._advance(look, pair)
        for look, pair in ahead:
            yield look.frame, self._advance(look, pair)

    def finish(self) -> Events:
        """Events that the lag holds back after the last frame."""
        held, self._held = self._held, []
        return events_of(held, self._sensor or Sensor(1, 1))

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def __enter__(self) -> EventSimulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look(self, frame: Frame) -> _Look:
        return _Look(frame, cv2.log(frame.light + np.float32(self.traits.dark)), guide_of(frame.light))

    def _pair(self, before: _Look, after: _Look) -> Callable[[], Between]:
        """Begin to look for motion; the answer is there when it is called."""
        is_small = min(before.level.shape) < SMALLEST_SIDE
        if self.stepping.interpolate == "off" or is_small or after.frame.is_cut:
            return lambda: Straight(before.level, after.level)
        guides = before.guide, after.guide
        there = self._ask(flow_between, *guides)
        back = self._ask(flow_between, *guides[::-1])
        return lambda: motion_between(before.level, after.level, guides, (there(), back()))

    def _ask(self, call: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> Callable[[], T]:
        """Begin a computation; the answer is there when it is called."""
        if self._pool is None:
            result = call(*arguments, **named)
            return lambda: result
        return self._pool.submit(call, *arguments, **named).result

    def _advance(self, look: _Look, pair: Callable[[], Between] | None) -> Events:
        frame, before = look.frame, self._before
        sensor = Sensor(frame.light.shape[1], frame.light.shape[0])
        if self._pixels is None or before is None or self._noise is None or pair is None:
            self._sensor, self._pixels = sensor, PixelArray(frame.light, frame.t, self.traits, self._rng)
            self._noise = Noise(frame.light.size, self.traits, self._rng)
            self.camera, found = frame.light, []
        elif sensor != self._sensor:
            raise RecordingError(f"a frame is {sensor}, the ones before were {self._sensor}; all must have one size")
        elif frame.t <= before.frame.t:
            raise RecordingError(f"a frame at {frame.t:.0f} µs follows one at {before.frame.t:.0f} µs; stamps ascend")
        else:
            self._between = between = pair()
            if frame.is_cut or (self.stepping.finds_cuts and is_cut(between, (before.guide, look.guide))):
                self.account.cuts.append(frame.t)
                self.account.num_cuts += 1
                self._pixels.restart(frame.light, frame.t, self._rng)
                self.camera, found = frame.light, []
            else:
                found = self._walk(self._pixels, before, look, between)
            found.append(self._noise.draw(frame.light, (before.frame.t, frame.t), self._rng))
        self._before = look
        self.account.num_frames += 1
        return self._ready(found, frame.t, sensor)

    def _walk(self, pixels: PixelArray, before: _Look, after: _Look, between: Between) -> list[Crossings]:
        """Step from one frame to the next; some levels are prepared while the sensor looks at one."""
        change = np.abs(after.level - before.level)
        self.account.largest_change = max(self.account.largest_change, float(change.max()))
        self.account.failed += between.failed
        threshold = min(self.traits.threshold_on, self.traits.threshold_off)
        num_steps = self.stepping.count(between, float(np.quantile(change, 0.99)), threshold)
        self.account.num_steps += num_steps
        level = between.level
        if self.stepping.learned is not None:
            learned = self.stepping.learned
            level = lambda share: learned(before.level, after.level, share)  # noqa: E731
        start, elapsed = before.frame.t, after.frame.t - before.frame.t
        queue = deque(self._ask(level, k / num_steps) for k in range(1, min(_AHEAD + 1, num_steps)))
        found, exposed, num_exposed = list[Crossings](), np.zeros_like(after.level), 0
        for k in range(1, num_steps + 1):
            if k + _AHEAD < num_steps:
                queue.append(self._ask(level, (k + _AHEAD) / num_steps))
            t = start + elapsed * k / num_steps
            reached = queue.popleft()() if k < num_steps else after.level
            crossings = pixels.expose_level(reached, t)
            found.append(crossings._replace(t=crossings.t + self.traits.lag_us))
            if self._exposure_us > 0 and t > after.frame.t - self._exposure_us:
                exposed += cv2.exp(reached) - np.float32(self.traits.dark)
                num_exposed += 1
        self.camera = exposed / np.float32(num_exposed) if num_exposed else after.frame.light
        return found

    def _ready(self, found: list[Crossings], t: float, sensor: Sensor) -> Events:
        """What is due by now, in order; what the lag carries past `t` is held."""
        if self.traits.lag_us > 0 and (self._held or found):
            every = Crossings(*(np.concatenate(column) for column in zip(*self._held, *found, strict=True)))
            is_due = every.t < t
            found = [Crossings(*(column[is_due] for column in every))]
            self._held = [Crossings(*(column[~is_due] for column in every))]
        events = events_of(found, sensor)
        self.account.num_events += len(events)
        return events
