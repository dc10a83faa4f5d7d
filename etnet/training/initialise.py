"""Where training begins: weights that fit, and attention that looks somewhere from the first update on."""

from __future__ import annotations

import math
from collections.abc import Iterable

import torch
from torch import Tensor, nn

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.blocks import Upsample
from etnet.nets.etnet import ETNet, Sequentialize
from etnet.nets.transformer import FeedForward

PLACE_GAINS = (3.0, 5.0, 8.0, 12.0)
"""q·k gains of the heads that look at places: on a 14 × 14 grid the first reads about ninety tokens, the last ten."""
CONTENT_GAIN = 1.5
PLACE_SHARE = 0.2
"""Size of the content in the channels that tell places, so that it does not drown the positions there."""
MIX_GAIN = 0.6
"""How much of what it read a token adds to itself."""
FEED_FORWARD_GAIN = 0.3
"""Small writes to the residual stream, so that content and positions are still there in the last layer."""

DEEP_PATH = ("tpa.", "upsampler.0.", "upsampler.1.")
"""Names of the parts that `start_locally` initialises again."""


def start_locally(model: ETNet, generator: torch.Generator) -> None:
    """Initialise TPA and the first two blocks of the upsampler: alive (He et al. 2015), attention local."""
    for module in model.tpa.modules():
        if isinstance(module, FeedForward):
            nn.init.xavier_normal_(module.contract.weight, gain=FEED_FORWARD_GAIN, generator=generator)
            nn.init.zeros_(module.contract.bias)
        if isinstance(module, Sequentialize) and isinstance(module.norm, nn.LayerNorm):
            _make_room_for_places(module.norm, _fast_channels(model.config.dim, model.config.dim // model.config.heads))
    start_upsampler(list(model.upsampler)[:2], generator)
    start_attention_locally(model, generator)


def start_upsampler(blocks: Iterable[nn.Module], generator: torch.Generator) -> None:
    """Initialise blocks of the upsampler again, each unit firing for half of what it sees (He et al. 2015)."""
    for block in blocks:
        assert isinstance(block, Upsample)
        convolution = block.conv.conv
        nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu", generator=generator)
        assert convolution.bias is not None
        nn.init.zeros_(convolution.bias)


@torch.no_grad()
def start_attention_locally(model: ETNet, generator: torch.Generator) -> None:
    """Set every attention so that a token adds some of its neighbours and of its likes to itself.

    With independent q and k (Xavier) the logits are near zero, attention starts as a plain mean and, where skips carry
    the picture, stays one. Shared q and k make logits a similarity (compare mimetic initialisation, Trockman & Kolter
    2023): half of the heads compare the positions' fast channels (place), the others a random projection (content).
    Value and output projections are a rotation and its inverse, so that each head averages its own share of a token.
    """
    for module in model.tpa.modules():
        if not isinstance(module, MultiHeadAttention):
            continue
        dim = module.in_proj_weight.shape[1]
        rotation = torch.linalg.qr(torch.randn(dim, dim, generator=generator)).Q
        shared = _similarity(dim, module.heads, generator)
        for part in range(2):
            noise = 0.02 * torch.randn(dim, dim, generator=generator)
            module.in_proj_weight[part * dim : (part + 1) * dim] = shared + noise
        module.in_proj_weight[2 * dim :] = rotation
        module.in_proj_bias.zero_()
        module.out_proj.weight.copy_(MIX_GAIN * rotation.T)
        module.out_proj.bias.zero_()


def take_fitting(model: nn.Module, weights: dict[str, Tensor], without: tuple[str, ...] = ()) -> list[str]:
    """Copy every tensor whose name and shape fit; the names of the model's tensors that stayed as they were.

    Names that begin with one of `without` are left alone.
    """
    own = {name: value for name, value in model.state_dict().items() if not name.startswith(without)}
    fitting = {name: value for name, value in weights.items() if name in own and own[name].shape == value.shape}
    model.load_state_dict(fitting, strict=False)
    return sorted(set(model.state_dict()) - set(fitting))


def _similarity(dim: int, heads: int, generator: torch.Generator) -> Tensor:
    """The projection that queries and keys begin with."""
    width, places = dim // heads, heads // 2
    rows = []
    for head in range(heads):
        if head < places:
            gain = PLACE_GAINS[round(head * (len(PLACE_GAINS) - 1) / max(1, places - 1))]
            rows.append(math.sqrt(gain) * _fast_channels(dim, width))
        else:
            projection = torch.linalg.qr(torch.randn(dim, width, generator=generator)).Q.T
            rows.append(math.sqrt(CONTENT_GAIN) * projection)
    return torch.cat(rows)


@torch.no_grad()
def _make_room_for_places(norm: nn.LayerNorm, places: Tensor) -> None:
    norm.weight[places.any(dim=0)] = PLACE_SHARE
    norm.bias[places.any(dim=0)] = 0.0


def _fast_channels(dim: int, width: int) -> Tensor:
    """Rows that pick the channels in which the 2-D sinusoid turns fastest: half for rows, half for columns."""
    chosen = torch.zeros(width, dim)
    half = width // 2
    chosen[torch.arange(half), torch.arange(half)] = 1.0
    chosen[torch.arange(half, width), dim // 2 + torch.arange(width - half)] = 1.0
    return chosen
