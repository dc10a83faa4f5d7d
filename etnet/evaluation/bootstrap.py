"""Intervals for means over frames of video: neighbours are alike, so whole blocks of frames are drawn, not frames."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

Averaging = Literal["sequences", "frames"]
RESAMPLES = 2_000


class Interval(NamedTuple):
    """A mean and the bounds between which `level` of its resampled values lie."""

    mean: float
    low: float
    high: float


def average(sequences: Sequence[Float[np.ndarray, " n"]], averaging: Averaging) -> float:
    """The mean of the sequences' means, or the mean of all frames. NaN marks a frame that has no value."""
    counts = [np.isfinite(values).sum() for values in sequences]
    means = [np.nanmean(values) for values, count in zip(sequences, counts, strict=True) if count]
    if not means:
        return math.nan
    return float(np.average(means, weights=None if averaging == "sequences" else [count for count in counts if count]))


def block_bootstrap(
    sequences: Sequence[Float[np.ndarray, " n"]],
    rng: np.random.Generator,
    averaging: Averaging = "sequences",
    block: int | None = None,
    level: float = 0.95,
) -> Interval:
    """Percentile interval of the average by circular block bootstrap (Politis & Romano 1992).

    Each sequence is resampled by itself: blocks of `block` frames in a row (√n by default) from a random start, going
    round at the end, until it has its length again. It speaks for other moments of these recordings, not for others.
    """
    finite = [values[np.isfinite(values)] for values in sequences]
    finite = [values for values in finite if len(values)]
    if not finite:
        return Interval(math.nan, math.nan, math.nan)
    resampled = np.stack([_resampled_means(values, rng, block) for values in finite])
    weights = None if averaging == "sequences" else [len(values) for values in finite]
    low, high = np.quantile(np.average(resampled, axis=0, weights=weights), [(1 - level) / 2, (1 + level) / 2])
    return Interval(average(finite, averaging), float(low), float(high))


def _resampled_means(
    values: Float[np.ndarray, " n"], rng: np.random.Generator, block: int | None
) -> Float[np.ndarray, " r"]:
    length = len(values)
    block = min(length, block or round(math.sqrt(length)))
    starts = rng.integers(0, length, (RESAMPLES, math.ceil(length / block)))
    # Sums of blocks as differences of a running sum, so that memory grows with √n for each resample and not with n.
    # The mean is taken off before, so that the running sum stays small beside what is told apart.
    mean = values.mean()
    running = np.concatenate(([0.0], np.cumsum(np.concatenate((values, values[:block])) - mean)))
    sums = running[starts + block] - running[starts]
    last = length - (starts.shape[1] - 1) * block  # the last block is cut, so that a resample has the same length
    sums[:, -1] = running[starts[:, -1] + last] - running[starts[:, -1]]
    return mean + sums.sum(axis=1) / length
