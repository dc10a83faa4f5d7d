"""Vectors as colours: three principal components, fitted once a recording, so that colours mean the same in play."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float32, Float64

from etnet.inspection.features import Feature, FeatureMap, feature_of, require_feature
from etnet.inspection.pyramid import Held, give_up_if
from etnet.nets.runtime import device_of
from etnet.playback.playback import Playback

RANGE = (1.0, 99.0)
"""Percentiles of a component over the fitted windows that become 0 and 1 of its colour."""
Centre = Literal["all", "place"]
"""What is taken off before: the mean of all vectors, or the mean of each place, which takes positions off, too."""


@dataclass(frozen=True, slots=True, eq=False)
class Basis:
    """Three directions, the strongest first, and the range of each that colours span.

    Signs are fixed: the largest entry of a direction is positive. A feature of fewer than three channels fills the
    rest with zeros.
    """

    feature: Feature
    mean: Float64[np.ndarray, "*place channels"]
    directions: Float64[np.ndarray, "3 channels"]
    low: Float64[np.ndarray, " 3"]
    high: Float64[np.ndarray, " 3"]
    explained: Float64[np.ndarray, " 3"]
    """Share of the variance that each direction holds."""

    def coordinates(self, map_: FeatureMap) -> Float64[np.ndarray, "rows columns 3"]:
        """How far each vector goes along the three directions."""
        return (map_.values.numpy().astype(np.float64) - self.mean) @ self.directions.T

    def colours(self, map_: FeatureMap) -> Float32[np.ndarray, "rows columns 3"]:
        """Red, green and blue, 0 … 1."""
        span = np.where(self.high > self.low, self.high - self.low, 1.0)
        return np.clip((self.coordinates(map_) - self.low) / span, 0, 1).astype(np.float32)


def fit_basis(maps: Iterable[FeatureMap], centre: Centre = "all") -> Basis:
    """Fit to all vectors of some maps of one feature, in double precision."""
    held = list(maps)
    if not held or any(map_.feature != held[0].feature for map_ in held):
        raise ValueError(f"a basis is fitted to maps of one feature; got {len(held)} maps of several or of none")
    stack = np.stack([map_.values.numpy() for map_ in held]).astype(np.float64)
    mean = stack.mean(0) if centre == "place" else stack.mean((0, 1, 2))
    vectors = (stack - mean).reshape(-1, stack.shape[-1])
    variances, eigenvectors = np.linalg.eigh(vectors.T @ vectors / len(vectors))
    strongest = np.argsort(-variances, kind="stable")[:3]
    directions = np.zeros((3, stack.shape[-1]))
    directions[: len(strongest)] = eigenvectors[:, strongest].T
    largest = np.take_along_axis(directions, np.abs(directions).argmax(1)[:, None], axis=1)
    directions *= np.where(largest < 0, -1.0, 1.0)
    explained = np.zeros(3)
    explained[: len(strongest)] = variances[strongest].clip(0) / max(float(variances.clip(0).sum()), 1e-300)
    low, high = np.percentile(vectors @ directions.T, RANGE, axis=0)
    return Basis(held[0].feature, mean, directions, low, high, explained)


def fit_basis_to_recording(
    playback: Playback,
    feature: Feature,
    num_windows: int = 8,
    warm_up: int = 8,
    centre: Centre = "all",
    cancelled: Callable[[], bool] | None = None,
) -> Basis:
    """Fit to the `sampled_maps` of a recording, all at once."""
    return fit_basis(sampled_maps(playback, feature, num_windows, warm_up, cancelled), centre)


def sampled_maps(
    playback: Playback,
    feature: Feature,
    num_windows: int = 8,
    warm_up: int = 8,
    cancelled: Callable[[], bool] | None = None,
    since: int = 0,
) -> Iterator[FeatureMap]:
    """What a basis is fitted to: `num_windows` windows spread evenly over the plan, one after the other, each after a
    cold start `warm_up` windows earlier.

    They depend on recording, plan, network and `feature` alone, not on what was looked at before; of a branch they are
    the original's, so that a change shows in the colours and not in their meaning. Each costs `warm_up` + 1 encodes
    and a pass of TPA. Windows before `since`, or before the playback's first, are left alone: of a live recording their
    events may have gone.
    """
    require_feature(playback.model, feature)
    while playback.parent is not None:
        playback = playback.parent
    since = max(since, playback.first)
    for index in sampled_windows(len(playback), num_windows, since):
        held = _cold(playback, index, max(since, index - warm_up), cancelled)
        yield feature_of(held, feature, playback.intervention_at(index))


def sampled_windows(num_windows: int, wanted: int, since: int = 0) -> tuple[int, ...]:
    """The windows that a basis is fitted to: the middles of `wanted` equal parts of the plan from `since` on."""
    there = num_windows - since
    if there < 1 or wanted < 1:
        raise ValueError(f"a basis is fitted to at least 1 window; got {wanted} of a plan of {there}")
    return tuple(sorted({since + (2 * part + 1) * there // (2 * wanted) for part in range(wanted)}))


def _cold(playback: Playback, index: int, start: int, cancelled: Callable[[], bool] | None) -> Held:
    """A window after a cold start at window `start`."""
    state, pyramid = None, None
    for i in range(start, index + 1):
        give_up_if(cancelled, "this basis")
        with torch.inference_mode():
            voxel = playback.voxel(i)[None].to(device_of(playback.model))
            pyramid, state = playback.model.encode(voxel, state, playback.intervention_at(i))
    assert pyramid is not None
    assert state is not None
    return Held(playback.model, index, pyramid, state)
