"""ET-Net (Weng et al., ICCV 2021): recurrent backbone → Token Pyramid Aggregation → multi-level upsampler."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import torch
from einops import rearrange
from jaxtyping import Float
from torch import Tensor, nn

from etnet.errors import ModelError
from etnet.nets.abilities import ALL_INTERVENTIONS, Abilities
from etnet.nets.attention import Attention, AttentionProbe, Observer
from etnet.nets.base import Pyramid
from etnet.nets.composed import NUM_LEVELS, RecurrentPyramid
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.positions import ORIGIN, Placement, grid_positions, raster_positions
from etnet.nets.runtime import precision_of
from etnet.nets.transformer import DecoderLayer, EncoderLayer

MAX_DEPTH = 64
"""Layers a scale: a bound for files that claim more than anybody trained."""


@dataclass(frozen=True, slots=True)
class ETNetConfig:
    """An ET-Net and its ablations, as fields. The defaults are the paper's best model as it was released."""

    bins: int = 5
    base_channels: int = 32
    """C₀; level l has C₀·2ˡ channels."""
    dim: int = 256
    """D, the tokens' width."""
    heads: int = 8
    feed_forward: int = 1024
    scales: int = 3
    """How many scales TPA aggregates, counted from the coarsest; 4 adds the head (scale 0)."""
    encoder_depth: int = 3
    decoder_depth: int = 2
    skips: bool = True
    """Skip connections from the backbone to the upsampler."""
    deepest_skip: int = NUM_LEVELS
    """The coarsest level that has one. Ours: with 1, what levels 2 and 3 know reaches the image through TPA alone."""
    projects_coarsest: bool = False
    """A 1×1 projection at the coarsest scale, as the paper says; identity as it was released."""
    token_norm: bool = False
    """Ours: LayerNorm on a scale's tokens before the positions are added."""
    context_norm: bool = False
    """Ours: LayerNorm on the aggregated tokens."""
    positions: Literal["raster", "grid"] = "raster"
    """"raster": one sinusoid over the flat index (paper). "grid": row and column apart (ours)."""
    scales_logits: bool = False
    """Ours: attention logits times log N / log 196, so that larger grids stay as sharp as the training crop."""
    dropout: float = 0.1
    """In training only."""
    normalise_voxels: bool = False
    squash: float = 0.0
    """Ours: counts far above this many events a bin grow as their logarithm only, v → ±s·log(1 + |v| / s); 0: never."""

    def __post_init__(self) -> None:
        if not 1 <= self.scales <= NUM_LEVELS + 1:
            raise ModelError(f"ETNetConfig.scales is {self.scales}; it takes 1 … 4")
        if not 0 <= self.deepest_skip <= NUM_LEVELS:
            raise ModelError(f"ETNetConfig.deepest_skip is {self.deepest_skip}; it takes 0 … {NUM_LEVELS}")
        if self.heads < 1 or self.dim % self.heads:
            raise ModelError(f"ETNetConfig.dim {self.dim} does not divide into {self.heads} heads")
        if not 0 <= self.squash < math.inf:
            raise ModelError(f"ETNetConfig.squash is {self.squash}; it takes 0 or a number of events")
        if min(self.bins, self.base_channels, self.dim, self.feed_forward) < 1:
            raise ModelError(
                f"ETNetConfig: bins {self.bins}, base_channels {self.base_channels}, dim {self.dim} and feed_forward "
                f"{self.feed_forward} are at least 1"
            )
        if not (1 <= self.encoder_depth <= MAX_DEPTH and 0 <= self.decoder_depth <= MAX_DEPTH):
            raise ModelError(
                f"ETNetConfig depths are {self.encoder_depth} and {self.decoder_depth}; they take 1 … {MAX_DEPTH} and "
                f"0 … {MAX_DEPTH}"
            )
        if self.dim != self.channels(NUM_LEVELS):
            raise ModelError(
                f"ETNetConfig.dim is {self.dim}; the upsampler adds it to {self.channels(NUM_LEVELS)} channels"
            )

    def channels(self, level: int) -> int:
        """C_l = C₀·2ˡ."""
        return self.base_channels * 2**level

    @property
    def skip_levels(self) -> frozenset[int]:
        """The levels whose features the upsampler adds; 0 is the head."""
        return frozenset(range(self.deepest_skip + 1)) if self.skips else frozenset()

    @property
    def scale_indices(self) -> tuple[int, ...]:
        """The aggregated scales from the coarsest (3) down; 0 is the head."""
        return tuple(range(NUM_LEVELS, NUM_LEVELS - self.scales, -1))

    @staticmethod
    def ablation(depth: int, scales: int, decoders: bool = True) -> ETNetConfig:
        """The paper's `ET-Net-A-sB`: A encoders and decoders a scale, ⌈A/2⌉ of them encoders; B scales."""
        encoders = -(-depth // 2) if decoders else depth
        return ETNetConfig(scales=scales, encoder_depth=encoders, decoder_depth=depth - encoders)


class Sequentialize(nn.Module):
    """A scale's feature map → tokens: cut into patches, project, add the positional code (paper, eq. 3)."""

    def __init__(self, config: ETNetConfig, scale: int) -> None:
        super().__init__()
        patch = PATCH // 2**scale
        is_identity = scale == NUM_LEVELS and not config.projects_coarsest
        self.project = nn.Identity() if is_identity else nn.Conv2d(config.channels(scale), config.dim, patch, patch)
        self.norm = nn.LayerNorm(config.dim) if config.token_norm else nn.Identity()
        self.code = raster_positions if config.positions == "raster" else grid_positions

    def forward(self, feature: Float[Tensor, "b c h w"], placement: Placement) -> Float[Tensor, "b n d"]:
        projected = self.project(feature)
        rows, columns = projected.shape[-2:]
        tokens = self.norm(rearrange(projected, "b d i j -> b (i j) d"))
        return tokens + self.code(rows, columns, tokens.shape[-1], placement).to(tokens, non_blocking=True)


class TokenPyramidAggregation(nn.Module):
    """One transformer block a scale; each decoder reads the next coarser scale (paper, Fig. 2).

    The coarsest scale's decoder reads its own encoder. The result is the mean of all encoders' and decoders' tokens.
    """

    def __init__(self, config: ETNetConfig) -> None:
        super().__init__()
        sizes = (config.dim, config.heads, config.feed_forward, config.dropout)
        self.scales = config.scale_indices
        self.sequentialize = nn.ModuleDict({str(s): Sequentialize(config, s) for s in self.scales})
        self.encoders = nn.ModuleDict(
            {
                str(s): nn.ModuleList(
                    EncoderLayer(*sizes, f"scale{s}.encoder.{i}", config.scales_logits)
                    for i in range(config.encoder_depth)
                )
                for s in self.scales
            }
        )
        self.decoders = nn.ModuleDict(
            {
                str(s): nn.ModuleList(
                    DecoderLayer(*sizes, f"scale{s}.decoder.{i}", config.scales_logits)
                    for i in range(config.decoder_depth)
                )
                for s in self.scales
            }
        )
        self.norm = nn.LayerNorm(config.dim) if config.context_norm else nn.Identity()

    def forward(self, levels: tuple[Tensor, ...], observer: Observer, placement: Placement) -> Float[Tensor, "b d i j"]:
        if observer.intervention.without_context and observer.probe is None:
            return torch.zeros_like(levels[NUM_LEVELS])
        encoded, streams = {}, []
        for scale in self.scales:
            tokens = self.sequentialize[str(scale)](levels[scale], placement)
            for layer in self.encoders[str(scale)]:  # pyright: ignore[reportGeneralTypeIssues]
                tokens = layer(tokens, observer)
            encoded[scale] = tokens

        for scale in self.scales:
            memory, tokens = encoded[min(scale + 1, NUM_LEVELS)], encoded[scale]
            for layer in self.decoders[str(scale)]:  # pyright: ignore[reportGeneralTypeIssues]
                tokens = layer(tokens, memory, observer)
            if scale not in observer.intervention.removed_scales:
                streams.append(encoded[scale])
                if len(self.decoders[str(scale)]) and not observer.intervention.without_decoders:  # pyright: ignore
                    streams.append(tokens)

        if not streams or observer.intervention.without_context:
            return torch.zeros_like(levels[NUM_LEVELS])
        context = self.norm(torch.stack(streams).mean(0))
        return rearrange(context, "b (i j) d -> b d i j", i=levels[NUM_LEVELS].shape[-2])


class ETNet(RecurrentPyramid):
    """The network of the paper's Fig. 1. State: hidden and cell of levels 1, 2, 3, in this order."""

    abilities = Abilities(
        attention=True, levels=NUM_LEVELS, gates=True, gradients=True, split=True, interventions=ALL_INTERVENTIONS
    )

    def __init__(self, config: ETNetConfig) -> None:
        super().__init__("etnet", config)
        self.config = config
        self.tpa = TokenPyramidAggregation(config)
        self._build_upsampler(config, outputs=1)

    def _laid_out(self, voxel: Tensor) -> Tensor:
        return super()._laid_out(squashed(voxel, self.config.squash) if self.config.squash else voxel)

    def decode(
        self,
        pyramid: Pyramid,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
        placement: Placement = ORIGIN,
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """TPA and upsampler: no memory, any frame by itself."""
        observer = Observer(probe, intervention)
        with precision_of(self.runtime, pyramid.levels[0].device.type):
            context = self.tpa(pyramid.levels, observer, placement)
            frame = self._image(context, pyramid, intervention, is_bounded=True)
        return frame, observer.attention(TokenGrid(pyramid.height, pyramid.width))


def squashed(voxel: Float[Tensor, "b bins h w"], scale: float) -> Float[Tensor, "b bins h w"]:
    """±s·log(1 + |v| / s): the identity for small counts, a logarithm for large ones."""
    return torch.sign(voxel) * scale * torch.log1p(voxel.abs() / scale)
