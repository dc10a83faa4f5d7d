"""How long a step will take at a sensor's size, told before anything of that size is run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.precision import best_of
from etnet.nets.runtime import device_of

if TYPE_CHECKING:
    from etnet.nets.presets import Network

_SIDES = (128, 256)
"""Pixels a side of the two squares that are run: a fifth of a second for our default network."""


def expected_step_seconds(model: Network, height: int, width: int) -> float:
    """Seconds of one step at this size, from two small ones. Right to about a third: caches and kernels differ."""
    with torch.inference_mode():
        seconds = []
        for side in _SIDES:
            voxel = torch.zeros(1, model.bins, side, side, device=device_of(model))
            seconds.append(best_of(lambda voxel=voxel: float(model(voxel).frame[0, 0, 0, 0]), runs=1))
    return extrapolated(seconds[0], seconds[1], TokenGrid(height, width).num_tokens)


def extrapolated(small: float, large: float, num_tokens: int) -> float:
    """Layers cost a·N and attention maps b·N² of N tokens: what N costs when two small grids cost `small`, `large`."""
    few, many = ((side // PATCH) ** 2 for side in _SIDES)
    square = max((large / many - small / few) / (many - few), 0.0)
    line = max(large / many - square * many, 0.0)
    return line * num_tokens + square * num_tokens**2
