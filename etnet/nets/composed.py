"""What our networks share: a step made of its two calls, and the recurrent U of ET-Net and E2VID."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor, nn

from etnet.nets.abilities import Abilities
from etnet.nets.attention import AttentionProbe
from etnet.nets.backbone import advance, check_voxel, upsample
from etnet.nets.base import Pyramid, Reconstructor, State, Step, variance_of
from etnet.nets.blocks import ConvReLU, RecurrentLevel, Upsample
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.padding import crop_to_sensor, pad_to_grid
from etnet.nets.runtime import Runtime, precision_of

NUM_LEVELS = 3
"""Recurrent levels of the U; level l works at 1/2ˡ."""


class Composed(nn.Module):
    """A network whose whole step is `decode` after `encode`; `_advance` is what differs in `encode`."""

    abilities = Abilities()
    post_processing = "none"

    def __init__(self, name: str, bins: int, normalise_voxels: bool) -> None:
        super().__init__()
        self.name = name
        self.bins = bins
        self.normalise_voxels = normalise_voxels
        self.card: dict[str, object] = {}
        self.runtime = Runtime()

    def forward(
        self: Reconstructor,
        voxel: Float[Tensor, "b bins h w"],
        state: State | None = None,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
    ) -> Step:
        pyramid, state = self.encode(voxel, state, intervention)
        frame, attention = self.decode(pyramid, probe, intervention)
        return Step(frame, state, attention, variance_of(self, state))

    def encode(
        self, voxel: Float[Tensor, "b bins h w"], state: State | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Pyramid, State]:
        """Advance the memory by one window: all that a later frame depends on."""
        check_voxel(voxel, self.bins)
        with precision_of(self.runtime, voxel.device.type):
            levels, after = self._advance(self._laid_out(voxel), state, intervention)
        return Pyramid(levels, voxel.shape[-2], voxel.shape[-1]), after

    def _advance(
        self, voxel: Tensor, state: State | None, intervention: Intervention
    ) -> tuple[tuple[Tensor, ...], State]:
        raise NotImplementedError

    def _laid_out(self, voxel: Tensor) -> Tensor:
        return voxel.contiguous(memory_format=torch.channels_last) if self.runtime.channels_last else voxel


@runtime_checkable
class PyramidConfig(Protocol):
    """What the recurrent U reads of a configuration."""

    @property
    def bins(self) -> int:
        """Input channels."""
        ...

    @property
    def normalise_voxels(self) -> bool:
        """Whether non-zero voxels get mean 0 and deviation 1."""
        ...

    @property
    def skip_levels(self) -> frozenset[int]:
        """The levels whose features the upsampler adds; 0 is the head."""
        ...

    def channels(self, level: int) -> int:
        """C_l."""
        ...


class RecurrentPyramid(Composed):
    """Head, recurrent levels and upsampler. State: hidden and cell of levels 1, 2, 3, in this order.

    A subclass puts its own modules between `__init__` and `_build_upsampler`, so that parameters keep their order.
    """

    def __init__(self, name: str, config: PyramidConfig) -> None:
        super().__init__(name, config.bins, config.normalise_voxels)
        channels = [config.channels(level) for level in range(NUM_LEVELS + 1)]
        self.skip_levels = config.skip_levels
        self.head = ConvReLU(config.bins, channels[0])
        self.backbone = nn.ModuleList(RecurrentLevel(channels[i], channels[i + 1]) for i in range(NUM_LEVELS))

    def _build_upsampler(self, config: PyramidConfig, outputs: int) -> None:
        channels = [config.channels(level) for level in range(NUM_LEVELS + 1)]
        self.upsampler = nn.ModuleList(Upsample(channels[i + 1], channels[i]) for i in reversed(range(NUM_LEVELS)))
        self.tail = nn.Conv2d(channels[0], outputs, kernel_size=1)

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The pyramid of the step that ended in `state_after`: its hidden states, and the head once more."""
        check_voxel(voxel, self.bins)
        with precision_of(self.runtime, voxel.device.type):
            head = self.head(self._laid_out(voxel))
        return Pyramid((head, *state_after.tensors[::2]), voxel.shape[-2], voxel.shape[-1])

    def _advance(
        self, voxel: Tensor, state: State | None, intervention: Intervention
    ) -> tuple[tuple[Tensor, ...], State]:
        """Recurrent convolution backbone (ET-Net's paper, eq. 2)."""
        return advance(self.head(voxel), self.backbone, state, intervention)

    def _laid_out(self, voxel: Tensor) -> Tensor:
        return super()._laid_out(pad_to_grid(voxel))

    def _image(self, deepest: Tensor, pyramid: Pyramid, intervention: Intervention, is_bounded: bool) -> Tensor:
        """Multi-level upsampler (ET-Net's paper, eq. 4) at sensor size; the last layer and the sigmoid in fp32."""
        skips = self.skip_levels - intervention.removed_skips
        image = upsample(deepest, pyramid.levels, self.upsampler, skips)
        with torch.autocast(image.device.type, enabled=False):
            frame = self.tail(image.float())[:, :1]
            frame = torch.sigmoid(frame) if is_bounded else frame
        return crop_to_sensor(frame, pyramid.height, pyramid.width)
