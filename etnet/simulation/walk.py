"""The way from frame to frame: how finely it is gone, and the log intensity at each step."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, ParamSpec, TypeVar

import cv2
import numpy as np

from etnet.errors import RecordingError
from etnet.simulation.beginning import Beginning
from etnet.simulation.footage import Frame
from etnet.simulation.motion import (
    SMALLEST_SIDE,
    Between,
    Flow,
    Guide,
    Level,
    Moving,
    Straight,
    flow_between,
    guide_of,
    is_cut,
    motion_between,
)  # fmt: skip

MOST_STEPS = 32
"""Steps between two frames, at most: what is faster than so many pixels a frame is stepped over coarsely."""
_STEPS_A_PIXEL = 1.5
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
    to `most_steps`. Finer than two thirds of a pixel it does not go: there the signal is all but straight, and several
    events of one step lie on that line. A number takes so many steps along the flow; "off" runs straight from frame to
    frame, cuts included.
    """

    interpolate: Interpolate = "auto"
    most_steps: int = MOST_STEPS
    finds_cuts: bool = True
    learned: Learned | None = None
    is_sampled: bool = False
    """The levels themselves count, for an exposure or slow pixels: "auto" then takes steps finer than 2/3 pixel."""

    def __post_init__(self) -> None:
        if isinstance(self.interpolate, int) and not 1 <= self.interpolate <= 1000:
            raise RecordingError(f"interpolate is {self.interpolate}; it takes auto, off, or 1 to 1000 steps a frame")

    def count(self, motion: float, change: float) -> int:
        """Steps for a motion in pixels and a change in events of one pixel."""
        if self.interpolate == "off":
            return 1
        if isinstance(self.interpolate, int):
            return self.interpolate
        finest = self.most_steps if self.is_sampled else math.ceil(_STEPS_A_PIXEL * motion) + 1
        return min(max(1, math.ceil(motion), min(math.ceil(change), finest)), self.most_steps)


@dataclass(frozen=True, eq=False, slots=True)
class Passage:
    """The way to `frame` from the one before it, whose moment is `begins` (None: it is the first).

    `steps` are the moments (µs) on the way with their log intensity, the frame's own last; none where a new scene
    begins. `change` is the largest change of log intensity.
    """

    frame: Frame
    begins: float | None
    is_cut: bool
    steps: Iterable[tuple[float, Level]]
    num_steps: int = 0
    change: float = 0.0
    between: Between | None = None


@dataclass(frozen=True, eq=False, slots=True)
class _Look:
    """A frame as the pixels and the search for motion want it."""

    frame: Frame
    level: Level
    guide: Guide


class Walk:
    """Goes from frame to frame and keeps one of them. Its answers do not depend on the number of threads."""

    def __init__(
        self,
        stepping: Stepping,
        dark: float,
        threshold: float,
        threads: int = 2,
        beginning: Beginning | None = None,
    ) -> None:
        """Log intensity is log(light + `dark`); `threshold` is the change of it that makes an event. What is found out
        about the frames that `beginning` keeps is kept there."""
        self._stepping, self._dark, self._threshold = stepping, dark, threshold
        self._beginning = beginning or Beginning(0.0, 0)
        self._pool = ThreadPoolExecutor(threads, "simulation") if threads > 1 else None
        self._before: _Look | None = None

    def to(self, frame: Frame) -> Passage:
        """The passage to one more frame. Its steps are computed as they are taken, and must all be."""
        look, before = self._look(frame), self._before
        pair = None if before is None else self._pair(before, look, is_waited_for=True)
        self._before = look
        return self._passage(before, look, pair)

    def over(self, frames: Iterable[Frame]) -> Iterator[Passage]:
        """The passages to all frames in turn; flow is looked for a little ahead."""
        ahead: deque[tuple[_Look | None, _Look, Callable[[], Between] | None]] = deque()
        for frame in frames:
            look, before = self._look(frame), self._before
            ahead.append((before, look, None if before is None else self._pair(before, look)))
            self._before = look
            if len(ahead) > (_AHEAD if self._pool else 0):
                yield self._passage(*ahead.popleft())
        while ahead:
            yield self._passage(*ahead.popleft())

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)

    def _look(self, frame: Frame) -> _Look:
        before = self._before
        if before is not None and before.frame.light.shape != frame.light.shape:
            sizes = [f"{one.shape[1]}×{one.shape[0]}" for one in (frame.light, before.frame.light)]
            raise RecordingError(f"a frame is {sizes[0]}, the one before was {sizes[1]}; all must have one size")
        if before is not None and frame.t <= before.frame.t:
            raise RecordingError(f"a frame at {frame.t:.0f} µs follows one at {before.frame.t:.0f} µs; stamps ascend")
        look = self._beginning.known(frame, "look", self._dark)
        if look is None:
            look = _Look(frame, cv2.log(frame.light + np.float32(self._dark)), guide_of(frame.light))
            self._beginning.keep(frame, "look", self._dark, look, look.level.nbytes + look.guide.nbytes)
        return look

    def _pair(self, before: _Look, after: _Look, is_waited_for: bool = False) -> Callable[[], Between]:
        """Begin to look for motion; the answer is there when it is called.

        Where somebody waits for it, the two directions are looked for side by side; else one thread does all of a pair,
        and another one of the next.
        """
        is_small = min(before.level.shape) < SMALLEST_SIDE
        if self._stepping.interpolate == "off" or is_small or after.frame.is_cut:
            return lambda: Straight(before.level, after.level)
        known = self._beginning.known(after.frame, "motion", self._dark)
        if known is not None:
            return lambda: known
        guides = before.guide, after.guide
        if not is_waited_for:
            return self._ask(lambda: self._motion(before, after, (flow_between(*guides), flow_between(*guides[::-1]))))
        there, back = self._ask(flow_between, *guides), self._ask(flow_between, *guides[::-1])
        return lambda: self._motion(before, after, (there(), back()))

    def _motion(self, before: _Look, after: _Look, flows: tuple[Flow, Flow]) -> Between:
        between = motion_between(before.level, after.level, flows)
        self._beginning.keep(after.frame, "motion", self._dark, between, between.num_bytes)
        return between

    def _ask(self, call: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> Callable[[], T]:
        """Begin a computation; the answer is there when it is called."""
        if self._pool is None:
            result = call(*arguments, **named)
            return lambda: result
        return self._pool.submit(call, *arguments, **named).result

    def _passage(self, before: _Look | None, after: _Look, pair: Callable[[], Between] | None) -> Passage:
        if before is None or pair is None:
            return Passage(after.frame, None, after.frame.is_cut, ())
        between = pair()
        finds_cuts = self._stepping.finds_cuts
        if after.frame.is_cut or (finds_cuts and is_cut(between, (before.guide, after.guide))):
            return Passage(after.frame, before.frame.t, True, ())
        change = cv2.absdiff(after.level, before.level)
        num_steps = self._stepping.count(between.motion, float(np.quantile(change, 0.99)) / self._threshold)
        steps = self._steps(before, after, between, num_steps)
        return Passage(after.frame, before.frame.t, False, steps, num_steps, float(change.max()), between)

    def _steps(self, before: _Look, after: _Look, between: Between, num_steps: int) -> Iterator[tuple[float, Level]]:
        """Some levels are prepared while the sensor looks at one."""
        level, learned = between.level, self._stepping.learned
        if learned is not None:

            def level(share: float) -> Level:
                return learned(before.level, after.level, share)

        start, elapsed = before.frame.t, after.frame.t - before.frame.t
        version = self._dark, num_steps, learned
        known: list[Level] | None = self._beginning.known(after.frame, "steps", version)
        if known is not None:
            yield from ((start + elapsed * k / num_steps, level) for k, level in enumerate(known, start=1))
            yield after.frame.t, after.level
            return
        keeps, gone = self._beginning.holds(after.frame), list[Level]()
        queue = deque(self._ask(level, k / num_steps) for k in range(1, min(_AHEAD + 1, num_steps)))
        for k in range(1, num_steps):
            if k + _AHEAD < num_steps:
                queue.append(self._ask(level, (k + _AHEAD) / num_steps))
            found = queue.popleft()()
            if keeps:
                gone.append(found)
            yield start + elapsed * k / num_steps, found
        if keeps:
            self._beginning.keep(after.frame, "steps", version, gone, sum(one.nbytes for one in gone))
        yield after.frame.t, after.level


def flow_of(between: Between | None) -> np.ndarray | None:
    """How far the point that each pixel of the later frame shows has come since the earlier one (2 h w, pixels)."""
    return -np.moveaxis(between.backward.flow, 2, 0) if isinstance(between, Moving) else None
