"""Voxel grids → one tile a bin, without erasing single events when tiles are small."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float, UInt8

from etnet.render.colours import diverging, diverging_levels

PERCENTILE = 99.5
"""Of the magnitudes that are not zero: where the colours end."""


def signed_max_pool(grid: Float[np.ndarray, "n h w"], factor: int) -> Float[np.ndarray, "n hs ws"]:
    """Shrink by a whole factor; each cell keeps its value of largest magnitude, sign included.

    Averaging would fade a single event to nothing. Ragged edges are filled with zeros.
    """
    if factor == 1:
        return grid
    bins, height, width = grid.shape
    rows, columns = -(-height // factor), -(-width // factor)
    padded = np.zeros((bins, rows * factor, columns * factor), grid.dtype)
    padded[:, :height, :width] = grid
    across = _larger(padded[:, :, offset::factor] for offset in range(factor))
    return _larger(across[:, offset::factor] for offset in range(factor))


def _larger(parts: Iterable[np.ndarray]) -> np.ndarray:
    """Elementwise, the value of largest magnitude; +v wins over −v, so the order of the parts is of no account."""
    parts = iter(parts)
    high = low = next(parts)
    for part in parts:
        high, low = np.maximum(high, part), np.minimum(low, part)
    return np.where(high >= -low, high, low)


def voxel_limit(grid: Float[np.ndarray, "n h w"]) -> float:
    """The magnitude at which colours end: the 99.5th percentile of what is not zero; 1 for an empty grid."""
    active = np.abs(grid[grid != 0])
    if active.size == 0:
        return 1.0
    place = min(int(active.size * PERCENTILE / 100), active.size - 1)
    return max(float(np.partition(active, place)[place]), 1e-3)


def voxel_tiles(
    grid: Float[np.ndarray, "n h w"], tile_width: int, limit: float | None = None
) -> tuple[UInt8[np.ndarray, "n hs ws 3"], float]:
    """Coloured tiles no wider than about `tile_width`, and the magnitude at which their colours end."""
    end = voxel_limit(grid) if limit is None else limit
    return diverging()[voxel_levels(grid, tile_width, end)], end


def voxel_levels(grid: Float[np.ndarray, "n h w"], tile_width: int, limit: float) -> UInt8[np.ndarray, "n hs ws"]:
    """The same tiles as places in the ramp `diverging`."""
    return diverging_levels(signed_max_pool(grid, pooled_by(grid.shape[-1], tile_width)), limit)


def pooled_by(width: int, tile_width: int) -> int:
    """How many pixels of a grid a tile's pixel is wide."""
    return max(1, round(width / tile_width))
