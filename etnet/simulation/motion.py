"""Frames between two frames: optical flow both ways (DIS, Kroeger et al. 2016), checked, warped and blended.

What is blended is log intensity, because that is what an event pixel compares. Everything is a pure function of the two
frames: no random number, and no result that depends on the number of threads (`tests/simulation/test_motion.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

SMALLEST_SIDE = 24
"""Pixels a side below which no flow is looked for."""
_SLACK, _SLACK_SHARE = 0.5, 0.2
"""Pixels, and share of the displacement, by which forward and backward flow may miss each other."""
_FAITH = 1e-3
"""Weight of a source that the check rejects, where the other is rejected too."""
_ENOUGH = 4.0
"""1 ÷ the trust below which the straight line begins to take over."""
CUT_FAILED, CUT_CHANGED = 0.5, 0.35
"""A cut: flow fails in more than this share of the picture, and this share of its grey values differs."""

Level = Float32[np.ndarray, "h w"]
Flow = Float32[np.ndarray, "h w 2"]
Guide = UInt8[np.ndarray, "h w"]


@dataclass(frozen=True, slots=True)
class Search:
    """How flow is looked for: the finest scale (0 is full size), patches and their distance there, sweeps that refine
    it at each scale, steps by which one patch is fitted."""

    finest: int
    patch: int
    stride: int
    sweeps: int
    descents: int


SEARCHES = ((10_000, Search(0, 8, 3, 8, 8)), (120_000, Search(1, 8, 3, 8, 5)), (10**9, Search(1, 12, 6, 5, 8)))
"""By the pixels of a picture up to which each is taken: what costs least for its error (`docs/simulation.md`)."""


@runtime_checkable
class Between(Protocol):
    """What lies between two frames."""

    @property
    def motion(self) -> float:
        """Pixels that all but half a percent of the picture stay below."""
        ...

    @property
    def failed(self) -> float:
        """Share of the picture where no motion was found and a straight line is taken."""
        ...

    def level(self, share: float) -> Level:
        """Log intensity at a share of the way, 0 < share < 1."""
        ...


@dataclass(frozen=True, eq=False)
class Straight:
    """Each pixel's log intensity runs straight from one frame to the next."""

    before: Level
    after: Level
    motion: float = 0.0
    failed: float = 0.0

    def level(self, share: float) -> Level:
        """The straight line's value."""
        return cv2.addWeighted(self.before, 1 - share, self.after, share, 0)


@dataclass(frozen=True, eq=False)
class Checked:
    """Flow to the other frame (x, y in pixels), and how far it is believed: 0 … 1."""

    flow: Flow
    trust: Level


@dataclass(frozen=True, eq=False)
class Field:
    """The same on a grid of its own, `scale` times as coarse, with flow in that grid's pixels."""

    flow: Flow
    trust: Level
    scale: int

    @staticmethod
    def of(checked: Checked) -> Field:
        """Flow that was searched for at half the size says nothing finer."""
        height, width = checked.trust.shape
        scale = 1 << _search_for(checked.trust).finest
        if scale == 1:
            return Field(checked.flow, checked.trust, 1)
        size = -(-width // scale), -(-height // scale)
        edges = 0, size[1] * scale - height, 0, size[0] * scale - width
        flow, trust = (
            cv2.resize(cv2.copyMakeBorder(one, *edges, cv2.BORDER_REPLICATE), size, interpolation=cv2.INTER_AREA)
            for one in (checked.flow, checked.trust)
        )
        return Field(flow / np.float32(scale), trust, scale)

    def places(self, share: float) -> tuple[Flow, Level]:
        """How far from each place of the moment between its source lies (in the picture's pixels), and how far that is
        believed. One step of a fixed point."""
        grid = _grid(*self.trust.shape)
        place = cv2.addWeighted(grid, 1.0, self.flow, share, 0)
        found = cv2.remap(self.flow, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # pyright: ignore
        place = cv2.addWeighted(grid, 1.0, found, share, 0)
        trust = cv2.remap(self.trust, place, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # pyright: ignore
        return found * np.float32(share * self.scale), trust

    def at_full_size(self, one: np.ndarray, size: tuple[int, int]) -> np.ndarray:
        """Something on this grid, on that of the picture (width, height)."""
        if self.scale == 1:
            return one
        whole = one.shape[1] * self.scale, one.shape[0] * self.scale
        return cv2.resize(one, whole, interpolation=cv2.INTER_LINEAR)[: size[1], : size[0]]


@dataclass(frozen=True, eq=False)
class Moving:
    """Both frames moved along the flow to a moment between, and blended. Build it with `motion_between`."""

    before: Level
    after: Level
    forward: Checked
    backward: Checked
    fields: tuple[Field, Field]
    motion: float
    failed: float

    @property
    def num_bytes(self) -> int:
        """Memory beyond that of the two frames."""
        kept = (self.forward, self.backward, *(field for field in self.fields if field.scale > 1))
        return sum(one.flow.nbytes + one.trust.nbytes for one in kept)

    def level(self, share: float) -> Level:
        """Each source weighs by its nearness in time and by whether its pixel is seen in the other frame."""
        rest, field = 1.0 - share, self.fields[0]
        (way0, trust0), (way1, trust1) = self.fields[0].places(-share), self.fields[1].places(-rest)
        weight0 = (trust0 + np.float32(_FAITH)) * np.float32(rest)
        weight1 = (trust1 + np.float32(_FAITH)) * np.float32(share)
        believed, size = _believed(trust0, trust1), self.before.shape[::-1]
        way0, way1, share0, believed = (
            field.at_full_size(one, size) for one in (way0, way1, weight0 / (weight0 + weight1), believed)
        )
        moved0, moved1 = _moved(self.before, way0), _moved(self.after, way1)
        blended = moved1 + share0 * (moved0 - moved1)
        straight = cv2.addWeighted(self.before, rest, self.after, share, 0)
        return straight + believed * (blended - straight)


def motion_between(before: Level, after: Level, flows: tuple[Flow, Flow]) -> Moving:
    """Check the two flows against each other and keep what is needed to go from one frame to the next."""
    forward, backward = (_checked(*pair) for pair in (flows, flows[::-1]))
    length = cv2.magnitude(flows[0][..., 0], flows[0][..., 1])
    failed = float(np.mean(1 - _believed(forward.trust, backward.trust)))
    fields = Field.of(forward), Field.of(backward)
    return Moving(before, after, forward, backward, fields, float(np.quantile(length, 0.995)), failed)


def flow_between(first: Guide, second: Guide) -> Flow:
    """Dense flow from the first picture to the second, in pixels."""
    search = _search_for(first)
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    finder.setFinestScale(search.finest)
    finder.setPatchSize(search.patch)
    finder.setPatchStride(search.stride)
    finder.setVariationalRefinementIterations(search.sweeps)
    finder.setGradientDescentIterations(search.descents)
    return finder.calc(first, second, None)  # pyright: ignore[reportCallIssue, reportArgumentType]


def guide_of(light: Level) -> Guide:
    """The picture that motion is looked for in: light in a display's tone, 8 bits."""
    tone = cv2.pow(np.clip(light, 0, 1), 1 / 2.2)
    return cv2.convertScaleAbs(tone, alpha=255.0)


def is_cut(between: Between, guides: tuple[Guide, Guide]) -> bool:
    """Whether a new scene begins: no motion explains the change, and its grey values are others."""
    if between.failed < CUT_FAILED:
        return False
    counts = [np.bincount(guide.ravel() >> 3, minlength=32) for guide in guides]
    return float(np.abs(counts[0] - counts[1]).sum()) / (2 * guides[0].size) > CUT_CHANGED


def _checked(there: Flow, back: Flow) -> Checked:
    """The flow with its trust: near 1 where going there and back ends where it began.

    There both flows measure one motion, so the mean of the two is taken, whose error is smaller than that of either.
    """
    height, width = there.shape[:2]
    returned = cv2.remap(back, _grid(height, width) + there, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # pyright: ignore
    missed = there + returned
    slack = cv2.magnitude(there[..., 0], there[..., 1]) * np.float32(_SLACK_SHARE) + np.float32(_SLACK)
    ratio = cv2.magnitude(missed[..., 0], missed[..., 1]) / slack
    trust = cv2.exp(-ratio * ratio)
    return Checked(there - missed * (np.float32(0.5) * trust)[..., None], trust)


def _believed(trust0: Level, trust1: Level) -> Level:
    """1 where either source can be trusted, falling to 0 where neither can."""
    return np.minimum(np.maximum(trust0, trust1) * np.float32(_ENOUGH), np.float32(1))


def _moved(level: Level, way: Flow) -> Level:
    """Each pixel from so far away."""
    place = _grid(*level.shape) + way
    return cv2.remap(level, place, None, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)  # pyright: ignore


def _search_for(picture: Level | Guide) -> Search:
    return next(search for most, search in SEARCHES if picture.size <= most)


@lru_cache(maxsize=8)
def _grid(height: int, width: int) -> Flow:
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return np.stack([x, y], 2)
