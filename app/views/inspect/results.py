"""What looking inside has found, as plain values: jobs make them, inspectors are drawn from them.

Arrays are read-only float32 at sensor size ("h w") unless they say otherwise; frames are raw (0 … 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float32, Int64

if TYPE_CHECKING:
    from etnet.events.events import Events
    from etnet.inspection.causal_search import CausalSearch
    from etnet.nets.attention import Attention

Picture = Float32[np.ndarray, "h w"]


@dataclass(frozen=True, slots=True, eq=False)
class PartEffect:
    """What the frame loses when one part is taken away: without − with."""

    name: str
    """As `etnet.inspection.importance` calls it: "TPA", "scale 3", "skip 1" …"""
    difference: Picture

    @property
    def mean_absolute(self) -> float:
        """Mean of |difference| over the frame."""
        return float(np.abs(self.difference).mean())


@dataclass(frozen=True, slots=True, eq=False)
class AblatedParts:
    """The frame without each part in turn − the frame: parts of the network, this window's events, the state before."""

    differences: dict[str, Picture]
    """By "TPA", "skip 0", …, "events now", "state before"."""
    levels: tuple[int, ...] = ()
    """Whose state is zeroed as "state before"."""

    def at(self, name: str, pixel: tuple[int, int]) -> float:
        """What a part moves a pixel by."""
        return float(self.differences[name][pixel[1], pixel[0]])


@dataclass(frozen=True, slots=True, eq=False)
class TwinFound:
    """Both runs, window by window: what a change does from its beginning on."""

    indices: tuple[int, ...]
    stamps: tuple[int, ...]
    """µs, when each window ends."""
    original: tuple[Picture, ...]
    changed: tuple[Picture, ...]

    @property
    def on_image(self) -> Float32[np.ndarray, " windows"]:
        """Mean |changed − original|."""
        return np.array([np.abs(b - a).mean() for a, b in zip(self.original, self.changed, strict=True)], np.float32)

    def at(self, pixel: tuple[int, int]) -> Float32[np.ndarray, " windows"]:
        """Changed − original at a pixel."""
        x, y = pixel
        return np.array([b[y, x] - a[y, x] for a, b in zip(self.original, self.changed, strict=True)], np.float32)

    def recovered_at(self, tolerance: float) -> int | None:
        """The window from which on no pixel is further off than `tolerance`; `None` where that is not reached."""
        off = [i for i in range(len(self.indices)) if np.abs(self.changed[i] - self.original[i]).max() > tolerance]
        first = off[-1] + 1 if off else 0
        return self.indices[first] if first < len(self.indices) else None


@dataclass(frozen=True, slots=True, eq=False)
class CauseFound:
    """A causal search so far, and the value that the pixel should have: `None` where any change counts."""

    search: CausalSearch
    towards: float | None


@dataclass(frozen=True, slots=True, eq=False)
class SpreadFound:
    """How far frames lie apart when events are left out at random, and whether that tells the error."""

    deviation: Picture
    num_done: int
    num_seeds: int
    since: int
    pearson: float | None = None
    """With the error against the camera; `None` where it saw nothing at that moment, or while draws are made."""
    spearman: float | None = None
    own: OwnSpread | None = None
    """What the network itself says of this; `None` for one that says nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnSpread:
    """The network's own standard deviation of each pixel, and whether it tells the error."""

    deviation: Picture
    pearson: float | None
    spearman: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Attended:
    """Attention with its values, from which rows of any query are computed, and the sinks found so far."""

    attention: Attention
    sinks: dict[str, Bool[np.ndarray, "heads tokens"]] = field(default_factory=dict)
    nbytes: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """A changed frame beside the original. `lpips` is `None` where the frame is too small for it."""

    original: Picture
    changed: Picture
    mse: float
    lpips: float | None


@dataclass(frozen=True, slots=True, eq=False)
class TracedWindow:
    """One window's events and what the pixel owes each of them; `t_start`, `t_stop` in µs."""

    index: int
    events: Events
    weights: Float32[np.ndarray, " n"]
    t_start: int
    t_stop: int


@dataclass(frozen=True, slots=True, eq=False)
class Traced:
    """One pixel of one window, traced back to events; the earliest window first."""

    pixel: tuple[int, int]
    value: float
    windows: tuple[TracedWindow, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RolledOut:
    """How much each token that enters TPA, scale by scale, takes part in the pixel's token that leaves it."""

    scales: tuple[int, ...]
    weights: Float32[np.ndarray, "scales tokens"]
    """Sums to 1 over both."""
    discard: float


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """One pixel's attention at one site, of one head or of the mean map, window after window."""

    indices: tuple[int, ...]
    stamps: tuple[int, ...]
    """µs, when each window ends."""
    along_row: Float32[np.ndarray, "windows columns"]
    """On the token row of the pixel, in × uniform."""
    entropy: Float32[np.ndarray, " windows"]
    """Bits, of the map that is followed."""
    near: Float32[np.ndarray, " windows"]
    """The share that falls within `reach` pixels of the pixel, a square."""
    even: float
    """What would fall there if all tokens were read alike."""
    num_tokens: int
    reach: int


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """The exact tensor that the network got for one window."""

    padded: Float32[np.ndarray, "bins hp wp"]
    borders: tuple[int, int, int, int]
    """Rows and columns of zeros: above, below, left, right."""
    limit: float
    """Colours run from −limit to +limit; 0 for an empty window."""
    is_normalised: bool
    seen: Bool[np.ndarray, "rows columns"] | None
    """Tokens whose position was met in training; `None` for a network without positions."""
    seen_source: str


@dataclass(frozen=True, slots=True, eq=False)
class Channels:
    """One plane of one level's step: its channels, most energy first."""

    level: int
    plane: str
    order: Int64[np.ndarray, " channels"]
    """Which channel of the network each one is."""
    values: Float32[np.ndarray, "channels h w"]
    energy: Float32[np.ndarray, " channels"]
    """Mean square of each, in the same order."""
    num_channels: int
    """Of the level; `values` holds the first of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Norms:
    """How strong the memory was after each of the last windows: root mean squares."""

    indices: tuple[int, ...]
    hidden: Float32[np.ndarray, "windows levels"]
    cell: Float32[np.ndarray, "windows levels"]


@dataclass(frozen=True, slots=True, eq=False)
class Remembered:
    """How many windows before this one each pixel needs; −1 where more than the deepest that was tried."""

    depths: tuple[int, ...]
    needed: Int64[np.ndarray, "h w"]
    mean_absolute: tuple[float, ...]
    """Of short memory − whole memory, for each depth."""
    tolerance: float
