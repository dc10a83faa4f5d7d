"""A step made of its two calls, and the recurrent backbone that ET-Net and E2VID share."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from etnet.nets.attention import AttentionProbe
from etnet.nets.backbone import advance, check_voxel
from etnet.nets.base import Pyramid, Reconstructor, State, Step
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.padding import pad_to_grid
from etnet.nets.runtime import Runtime, precision_of


class Composed(nn.Module):
    """A network whose whole step is `decode` after `encode`."""

    name: str
    bins: int
    normalise_voxels: bool
    runtime: Runtime
    card: dict[str, object]

    def forward(
        self: Reconstructor,
        voxel: Float[Tensor, "b bins h w"],
        state: State | None = None,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
    ) -> Step:
        pyramid, state = self.encode(voxel, state, intervention)
        frame, attention = self.decode(pyramid, probe, intervention)
        return Step(frame, state, attention)


class RecurrentPyramid(Composed):
    """Head and recurrent levels. State: hidden and cell of levels 1, 2, 3, in this order."""

    head: nn.Module
    backbone: nn.ModuleList

    def encode(
        self, voxel: Float[Tensor, "b bins h w"], state: State | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Pyramid, State]:
        """Recurrent convolution backbone (ET-Net's paper, eq. 2): all that a later frame depends on."""
        check_voxel(voxel, self.bins)
        with precision_of(self.runtime, voxel.device.type):
            levels, after = advance(self._head(voxel), self.backbone, state, intervention)
        return Pyramid(levels, voxel.shape[-2], voxel.shape[-1]), after

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The pyramid of the step that ended in `state_after`: its hidden states, and the head once more."""
        check_voxel(voxel, self.bins)
        with precision_of(self.runtime, voxel.device.type):
            head = self._head(voxel)
        return Pyramid((head, *state_after.tensors[::2]), voxel.shape[-2], voxel.shape[-1])

    def _head(self, voxel: Tensor) -> Tensor:
        padded = pad_to_grid(voxel)
        if self.runtime.channels_last:
            padded = padded.contiguous(memory_format=torch.channels_last)
        return self.head(padded)
