"""Noise, hot pixels and flips on a simulated clip (Stoffregen et al. 2020, as the paper uses them)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from etnet.training.config import AugmentConfig


@dataclass(frozen=True, eq=False)
class Clip:
    """What one clip gives the trainer. `flow[i]` (x, y; pixels) leads from frame i − 1 to frame i."""

    voxels: Float32[np.ndarray, "t bins h w"]
    frames: Float32[np.ndarray, "t h w"]
    flow: Float32[np.ndarray, "t 2 h w"]
    is_gamma: bool = False
    """Whether the frames are gamma-coded in a run whose target is linear."""


def augment(clip: Clip, config: AugmentConfig, rng: np.random.Generator) -> Clip:
    """A new clip: flipped, and with noise on its voxel grids. Frames and flow follow the flips."""
    if config.flips:
        clip = _flipped(clip, along_x=rng.random() < 0.5, along_y=rng.random() < 0.5)
    voxels = clip.voxels
    deviation = rng.uniform(*config.noise_std)
    if deviation > 0:
        voxels = voxels + np.float32(deviation) * rng.standard_normal(voxels.shape, np.float32)
    if config.hot_pixel_share > 0:
        voxels = voxels + _hot_pixels(voxels.shape[-2:], config, rng)
    return Clip(voxels, clip.frames, clip.flow, clip.is_gamma)


def _flipped(clip: Clip, along_x: bool, along_y: bool) -> Clip:
    rows, columns = slice(None, None, -1 if along_y else 1), slice(None, None, -1 if along_x else 1)
    sign = np.array([-1 if along_x else 1, -1 if along_y else 1], np.float32)[:, None, None]
    arrays = (clip.voxels, clip.frames, clip.flow * sign)
    voxels, frames, flow = (np.ascontiguousarray(array[..., rows, columns]) for array in arrays)
    return Clip(voxels, frames, flow, clip.is_gamma)


def _hot_pixels(size: tuple[int, ...], config: AugmentConfig, rng: np.random.Generator) -> Float32[np.ndarray, "h w"]:
    """The same pixels and values in every bin of every window."""
    hot = np.zeros(size, np.float32)
    count = int(rng.uniform(0, config.hot_pixel_share) * hot.size)
    where = rng.integers(0, hot.size, count)
    hot.reshape(-1)[where] = config.hot_pixel_std * rng.standard_normal(count, np.float32)
    return hot
