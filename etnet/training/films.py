"""A clip that a network is validated on."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Film:
    """Voxel grids and the frames at their ends, one after the other from a cold start."""

    name: str
    voxels: Float[Tensor, "t bins h w"]
    frames: Float[Tensor, "t 1 h w"]

    def to(self, device: torch.device) -> Film:
        """The same where a network is."""
        return Film(self.name, self.voxels.to(device), self.frames.to(device))
