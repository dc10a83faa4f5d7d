"""Events → voxel grid (Weng et al. 2021, §3.1, eq. 1)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64

from etnet.events.events import Events

if TYPE_CHECKING:
    from torch import Tensor

MIN_EVENTS = 3
"""Windows with fewer events give zeros, as the released code does."""


def voxel_array(events: Events, bins: int = 5) -> Float32[np.ndarray, "bins h w"]:
    """Vote each event's polarity into its two nearest bins (eq. 1), as numpy.

    Time runs from the first event of the window (bin 0) to its last (bin `bins` − 1). Fewer than 3 events give
    zeros; equal stamps go to bin 0. The sum of the grid is the sum of the polarities.
    """
    if bins < 1:
        raise ValueError(f"bins is {bins}; it takes at least 1")
    height, width = events.sensor.height, events.sensor.width
    size = height * width
    if len(events) < MIN_EVENTS:
        return np.zeros((bins, height, width), np.float32)
    grid = np.zeros((bins, size))
    pixel = events.y.astype(np.int64)
    pixel *= width
    pixel += events.x
    elapsed = events.t - events.t[0]
    span = int(elapsed[-1])
    if span == 0 or bins == 1:
        grid[0] = np.bincount(pixel, events.p, size)
        return grid.astype(np.float32).reshape(bins, height, width)

    # Events are ordered in time, so those between two bins are a slice. Each votes p·(1−f) below and p·f above:
    # the sums of p and of p·f by pixel are all that is needed. Whole numbers up to the division, so that an event on a
    # border has a share of 0 and leaves nothing behind in the next bin.
    place = elapsed * (bins - 1)
    edges = np.searchsorted(place, np.arange(bins) * span)
    edges[-1] = len(events)
    for lower, (start, stop) in enumerate(pairwise(edges)):
        polarity = events.p[start:stop].astype(np.float64)
        share = (place[start:stop] - lower * span) / span
        share *= polarity
        upper = np.bincount(pixel[start:stop], share, size)
        grid[lower] += np.bincount(pixel[start:stop], polarity, size) - upper
        grid[lower + 1] += upper
    return grid.astype(np.float32).reshape(bins, height, width)


@dataclass(frozen=True, slots=True, eq=False)
class BinVotes:
    """How each event votes: p·(1 − share) into bin `lower`, p·share into `lower` + 1 (none where the share is 0)."""

    lower: Int64[np.ndarray, " n"]
    share: Float64[np.ndarray, " n"]

    @property
    def upper(self) -> Int64[np.ndarray, " n"]:
        """The later bin; the same as `lower` where nothing is voted into it."""
        return self.lower + (self.share > 0)


def bin_votes(events: Events, bins: int = 5) -> BinVotes:
    """The votes of a window's events, one by one (eq. 1): what `voxel_array` sums up, for windows that it votes on."""
    span = int(events.t[-1] - events.t[0]) if len(events) else 0
    if span == 0 or bins == 1:
        return BinVotes(np.zeros(len(events), np.int64), np.zeros(len(events)))
    lower, rest = np.divmod((events.t - events.t[0]) * (bins - 1), span)
    return BinVotes(lower, rest / span)


def voxel_grid(events: Events, bins: int = 5) -> Float[Tensor, "bins h w"]:
    """`voxel_array` as a tensor on the CPU."""
    import torch

    return torch.from_numpy(voxel_array(events, bins))


def normalise_nonzero(voxel: Float[Tensor, "bins h w"]) -> Float[Tensor, "bins h w"]:
    """Shift and scale the non-zero entries to mean 0 and standard deviation 1, as E2VID and FireNet want it.

    Zeros stay zeros. A grid whose non-zero entries are all alike is returned as it is.
    """
    nonzero = voxel != 0
    count = int(nonzero.sum())
    if count == 0:
        return voxel
    centred = (voxel - voxel.sum() / count) * nonzero
    deviation = ((centred**2).sum() / count).sqrt()
    return centred / deviation if deviation > 0 else voxel
