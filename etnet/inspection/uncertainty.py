"""How sure a frame is: its spread when events are left out at random, and whether the spread tells the error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from etnet.inspection.pyramid import give_up_if
from etnet.inspection.twin import branch_starts
from etnet.playback.playback import Playback

NEAREST = 5_000
"""µs: a camera frame further from a window's end is not compared with it."""


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Frames of one window, each with another draw of events left out; as many as are made so far."""

    index: int
    since: int
    """The window from which on events were left out."""
    drop: float
    num_seeds: int
    """How many draws there will be."""
    exact: Float[Tensor, "h w"]
    """The frame of all events, raw."""
    frames: Float[Tensor, "seeds h w"]

    @property
    def is_whole(self) -> bool:
        """Whether every draw was made."""
        return len(self.frames) == self.num_seeds

    @property
    def mean(self) -> Float[Tensor, "h w"]:
        """The mean of the draws."""
        return self.frames.mean(0)

    @property
    def deviation(self) -> Float[Tensor, "h w"]:
        """Standard deviation over the draws (of a sample: n − 1); zero from a single one."""
        return self.frames.std(0) if len(self.frames) > 1 else torch.zeros_like(self.exact)


def dropout_spread(
    playback: Playback,
    index: int,
    drop: float = 0.2,
    num_seeds: int = 8,
    num_back: int = 8,
    first_seed: int = 0,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[Spread]:
    """Leave each event out with probability `drop`, from `num_back` windows earlier on, once for each of the seeds
    `first_seed` … ; the spread so far after each. One draw costs `num_back` + 1 encodes and a decode.

    What came before those windows is as it was: the spread is that of the recent events. A branch keeps its own
    intervention and its start is gone back to at most; of its own edit the share and the seed are replaced.
    """
    if not 0 < drop < 1:
        raise ValueError(f"drop is {drop}; it is a share of the events, between 0 and 1")
    if num_seeds < 1 or num_back < 0:
        raise ValueError(f"got {num_seeds} seeds and {num_back} windows back; wanted at least 1 and 0")
    exact = playback.at(index, cancelled=cancelled).frame[0, 0].cpu()
    since = max(playback.first, index - num_back, *(start for start in branch_starts(playback) if start <= index))
    frames = exact[None][:0]
    for seed in range(first_seed, first_seed + num_seeds):
        give_up_if(cancelled, "this spread")
        edit = replace(playback.edit_at(since), drop=drop, seed=seed)
        branch = playback.branch(since, playback.intervention_at(since), edit)
        frame = branch.at(index, cancelled=cancelled).frame[0, 0].cpu()
        frames = torch.cat((frames, frame[None]))
        yield Spread(index, since, drop, num_seeds, exact, frames)


def own_deviation(
    playback: Playback, index: int, cancelled: Callable[[], bool] | None = None
) -> Float[Tensor, "h w"] | None:
    """The square root of the network's own variance of each pixel (`Step.variance`); `None` where it estimates none."""
    variance = playback.at(index, cancelled=cancelled).variance
    return None if variance is None else variance[0, 0].clamp_min(0).sqrt().cpu()


def camera_error(
    playback: Playback, index: int, frame: Float[Tensor, "h w"], nearest: int = NEAREST
) -> Float[Tensor, "h w"] | None:
    """|frame, clipped to 0 … 1, − camera| against the camera's frame at the window's end; `None` where there is none
    within `nearest` µs, or it has another size.
    """
    seen = camera_frame(playback, index, nearest)
    return None if seen is None or seen.shape != frame.shape else (frame.cpu().clamp(0, 1) - seen).abs()


def camera_frame(playback: Playback, index: int, nearest: int = NEAREST) -> Float[Tensor, "h w"] | None:
    """The camera's frame at a window's end, 0 … 1; `None` where there is none within `nearest` µs."""
    truth, stamp = playback.recording.ground_truth, playback.windows[index].t_stop
    if truth is None or len(truth) == 0:
        return None
    found = truth.nearest(stamp)
    if abs(int(truth.stamps[found]) - stamp) > nearest:
        return None
    return torch.from_numpy(np.asarray(truth.read_frame(found), np.float32))


@dataclass(frozen=True, slots=True)
class Correlation:
    """How far the spread goes with the error over the pixels, −1 … 1; 0 where either is the same everywhere."""

    pearson: float
    spearman: float
    """Of the ranks: whether a pixel of larger spread has the larger error, however much."""


def correlation(spread: Float[Tensor, "h w"], error: Float[Tensor, "h w"]) -> Correlation:
    """Both coefficients, in double precision."""
    a, b = (map_.double().flatten().numpy() for map_ in (spread, error))
    return Correlation(_pearson(a, b), _pearson(_ranks(a), _ranks(b)))


def _pearson(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    length = float(np.sqrt((a @ a) * (b @ b)))
    return float(a @ b) / length if length > 0 else 0.0


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 0; equal values share the mean of theirs."""
    _, group, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    return (last - (counts + 1) / 2)[group]
