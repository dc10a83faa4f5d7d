"""PIE-Net and PIE-Net-Lite (PyPI `event-pienet`, MIT): a small recurrent U-Net that feeds its own frame back."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import interpolate, max_pool2d, pad, relu

from etnet.errors import ModelError
from etnet.nets.abilities import STATE_INTERVENTIONS, Abilities
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.base import Pyramid, State
from etnet.nets.blocks import ConvNorm, NormalisedConvLSTM
from etnet.nets.composed import Composed
from etnet.nets.intervention import ORIGINAL, Intervention


@dataclass(frozen=True, slots=True)
class PIENetConfig:
    """The defaults are PIE-Net as its file was trained; level l has `channels[l]`, level 0 is the stem."""

    bins: int = 5
    channels: tuple[int, ...] = (8, 16, 24, 32)
    pools: tuple[int, ...] = (2, 2, 5)
    """By how much each level is halved (or more) after its memory: the first level works at full size."""
    refines: bool = True
    """A 3×3 block after each memory. PIE-Net's published file has its weights; the published code leaves it out."""
    normalise_voxels: bool = False

    def __post_init__(self) -> None:
        # JSON knows no tuples.
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "pools", tuple(self.pools))
        if self.bins < 1 or min((*self.channels, *self.pools), default=0) < 1:
            raise ModelError(f"PIENetConfig: {self.bins} bins, channels {self.channels}, pools {self.pools}; all ≥ 1")
        if len(self.channels) != len(self.pools) + 1:
            raise ModelError(
                f"PIENetConfig.channels has {len(self.channels)} entries; wanted one more than the {len(self.pools)} "
                "pools, for the stem"
            )
        if any(width % NormalisedConvLSTM.GROUPS for width in self.channels[1:]):
            raise ModelError(f"PIENetConfig.channels is {self.channels}; behind the stem they are multiples of 4")


PIENET_PRESETS: dict[str, PIENetConfig] = {
    "pie-net": PIENetConfig(),
    "pie-net-lite": PIENetConfig(channels=(12, 16, 24), pools=(2, 2)),
}


class Level(nn.Module):
    """Remember, refine, scale and shift by what events and last frame are like on the whole; give the skip."""

    def __init__(self, channels_in: int, channels_out: int, described: int, refines: bool) -> None:
        super().__init__()
        self.memory = NormalisedConvLSTM(channels_in, channels_out)
        self.refine = ConvNorm(channels_out, channels_out) if refines else None
        self.modulate = nn.Conv2d(described, 2 * channels_out, kernel_size=1)

    def forward(
        self, image: Float[Tensor, "b c h w"], before: tuple[Tensor, Tensor] | None, description: Tensor
    ) -> tuple[Float[Tensor, "b d h w"], tuple[Tensor, Tensor]]:
        hidden, cell = self.memory(image, before)
        skip = hidden if self.refine is None else self.refine(hidden) + hidden
        scale, shift = self.modulate(description).chunk(2, dim=1)
        return skip * (1 + scale) + shift, (hidden, cell)


class Rise(nn.Module):
    """Enlarge, and fuse with the skip; the skip is weighted by the variance of the last frame."""

    def __init__(self, channels_in: int, channels_out: int, scale: int) -> None:
        super().__init__()
        self.scale = scale
        self.trust = nn.Conv2d(1, channels_in, kernel_size=1)
        self.fuse = ConvNorm(2 * channels_in, channels_out)

    def forward(
        self, image: Float[Tensor, "b c i j"], skip: Float[Tensor, "b c h w"], variance: Tensor | None
    ) -> Float[Tensor, "b d h w"]:
        height, width = skip.shape[-2:]
        image = interpolate(image, scale_factor=self.scale, mode="bilinear", align_corners=True)
        down, across = height - image.shape[-2], width - image.shape[-1]
        image = pad(image, (across // 2, across - across // 2, down // 2, down - down // 2))
        if variance is not None:
            seen = interpolate(variance, size=(height, width), mode="bilinear", align_corners=True)
            skip = skip * torch.sigmoid(self.trust(seen))
        return self.fuse(torch.cat((skip, image), dim=1))


class PIENet(Composed):
    """State: hidden and cell of each level from the finest, then the last frame and its variance.

    Both come back with the next window, so nothing is left for `decode` but to hand them over. At a cold start the
    last frame is zero and skips pass whole.
    """

    abilities = Abilities(gradients=True, variance=True)

    def __init__(self, config: PIENetConfig) -> None:
        super().__init__("pie-net", config.bins, config.normalise_voxels)
        self.config = config
        widths, pools = config.channels, config.pools
        self.abilities = Abilities(levels=len(pools), gradients=True, variance=True, interventions=STATE_INTERVENTIONS)
        self.events_stem = ConvNorm(config.bins, widths[0])
        self.frame_stem = ConvNorm(1, widths[0])
        self.levels = nn.ModuleList(
            Level(widths[i], widths[i + 1], 2 * widths[0], config.refines) for i in range(len(pools))
        )
        self.rises = nn.ModuleList(Rise(widths[i + 1], widths[i], pools[i]) for i in reversed(range(len(pools))))
        self.latent = nn.Conv2d(widths[0], 3, kernel_size=1)
        self.offset = ConvNorm(3, 1)

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """The frame that `encode` made. There is no attention to probe."""
        return pyramid.levels[0], None

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The frame that lies in the state."""
        return Pyramid((state_after.tensors[-2],), voxel.shape[-2], voxel.shape[-1])

    def variance(self, state: State) -> Float[Tensor, "b 1 h w"]:
        """Variance of each pixel of the frame that belongs to `state`."""
        return state.tensors[-1]

    def _advance(
        self, voxel: Tensor, state: State | None, intervention: Intervention
    ) -> tuple[tuple[Tensor, ...], State]:
        self._check_size(voxel)
        last = torch.zeros_like(voxel[:, :1]) if state is None else state.tensors[-2]
        variance = None if state is None else state.tensors[-1]
        events, frame = self.events_stem(voxel), self.frame_stem(last)
        description = torch.cat((events, frame), dim=1).mean((2, 3), keepdim=True)

        image, skips, memory = events + frame, [], []
        for index, (level, pool) in enumerate(zip(self.levels, self.config.pools, strict=True)):
            before = None if state is None else (state.tensors[2 * index], state.tensors[2 * index + 1])
            if index + 1 in intervention.zeroed_levels:
                before = None
            skip, after = level(image, before, description)
            memory += before if index + 1 in intervention.frozen_levels and before is not None else after
            skips.append(skip)
            image = max_pool2d(skip, pool)
        for rise, skip in zip(self.rises, reversed(skips), strict=True):
            image = rise(image, skip, variance)

        frame, variance = self._intensity(image)
        return (frame,), State((*memory, frame, variance))

    def _intensity(self, image: Tensor) -> tuple[Tensor, Tensor]:
        """Mean and variance of the intensity: with Z log-normal, I = (I₀ + k) Z − k, clipped to 0 … 1."""
        with torch.autocast(image.device.type, enabled=False):
            latent = self.latent(image.float())
            offset = relu(self.offset(latent))
            mean, variance, reference = relu(latent).chunk(3, dim=1)
            contrast = reference + offset
            return (contrast * mean - offset).clamp(0, 1), contrast**2 * variance

    def _check_size(self, voxel: Tensor) -> None:
        smallest = 1
        for pool in self.config.pools:
            smallest *= pool
        if min(voxel.shape[-2:]) < smallest:
            raise ModelError(
                f"voxel grid is {voxel.shape[-1]} × {voxel.shape[-2]} pixels; {self.name} takes at least "
                f"{smallest} × {smallest}"
            )
