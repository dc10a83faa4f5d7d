"""Where training begins: weights that fit, and attention that looks somewhere from the first update on."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from etnet.nets.attention import MultiHeadAttention
from etnet.nets.etnet import ETNet, Sequentialize
from etnet.nets.transformer import FeedForward

PLACE_GAINS = (1.5, 3.0, 5.0, 8.0)
"""q·k gains of the heads that look at places: the first sees about seven tokens each way, the last its neighbours."""
CONTENT_GAIN = 0.7
PLACE_SHARE = 0.2
"""Size of the content in the channels that tell places, so that it does not drown the positions there."""

RESIDUAL_GAIN = 0.3


DEEP_PATH = ("tpa.", "upsampler.0.", "upsampler.1.")
"""Names of the parts that `start_locally` begins anew."""


def start_locally(model: ETNet, generator: torch.Generator) -> None:
    """Set every attention's q and k alike, so that a token looks at its likes and its neighbours, and feed the deep path.

    With independent q and k (Xavier) the logits are near zero, attention starts as a plain mean and, where skips carry
    the picture, stays one. Shared q and k make logits a similarity (compare mimetic initialisation, Trockman & Kolter
    2023). Half of the heads compare the positions' fast channels (place), the others a random projection (content).
    The upsampler's first two blocks are drawn anew (He et al. 2015), so that no unit of the deep path begins dead.
    """
    for module in model.tpa.modules():
        if isinstance(module, MultiHeadAttention):
            _share_queries_and_keys(module, generator)
            _write_little(module.out_proj, generator)
        if isinstance(module, FeedForward):
            _write_little(module.contract, generator)
        if isinstance(module, Sequentialize) and isinstance(module.norm, nn.LayerNorm):
            _make_room_for_places(module.norm, _fast_channels(model.config.dim, model.config.dim // model.config.heads))
    for block in list(model.upsampler)[:2]:
        convolution = block.conv.conv  # pyright: ignore[reportAttributeAccessIssue]
        assert isinstance(convolution, nn.Conv2d)
        nn.init.kaiming_normal_(convolution.weight, nonlinearity="relu", generator=generator)
        assert convolution.bias is not None
        nn.init.zeros_(convolution.bias)


def take_fitting(model: nn.Module, weights: dict[str, Tensor], without: tuple[str, ...] = ()) -> list[str]:
    """Copy every tensor whose name and shape fit; the names of the model's tensors that stayed as they were.

    Names that begin with one of `without` are left alone.
    """
    own = {name: value for name, value in model.state_dict().items() if not name.startswith(without)}
    fitting = {name: value for name, value in weights.items() if name in own and own[name].shape == value.shape}
    model.load_state_dict(fitting, strict=False)
    return sorted(set(model.state_dict()) - set(fitting))


@torch.no_grad()
def _share_queries_and_keys(attention: MultiHeadAttention, generator: torch.Generator) -> None:
    dim = attention.in_proj_weight.shape[1]
    width = dim // attention.heads
    rows = []
    for head in range(attention.heads):
        if head < attention.heads // 2:
            gain = PLACE_GAINS[round(head * (len(PLACE_GAINS) - 1) / max(1, attention.heads // 2 - 1))]
            rows.append(math.sqrt(gain) * _fast_channels(dim, width))
        else:
            projection = torch.linalg.qr(torch.randn(dim, width, generator=generator)).Q.T
            rows.append(math.sqrt(CONTENT_GAIN) * projection)
    shared = torch.cat(rows)
    for part in range(2):
        noise = 0.02 * torch.randn(shared.shape, generator=generator)
        attention.in_proj_weight[part * dim : (part + 1) * dim] = shared + noise
    attention.in_proj_bias[: 2 * dim] = 0.0


def _write_little(layer: nn.Linear, generator: torch.Generator) -> None:
    """Small writes to the residual stream, so that content and positions are still there in the last layer."""
    nn.init.xavier_normal_(layer.weight, gain=RESIDUAL_GAIN, generator=generator)
    nn.init.zeros_(layer.bias)


@torch.no_grad()
def _make_room_for_places(norm: nn.LayerNorm, places: Tensor) -> None:
    norm.weight[places.any(dim=0)] = PLACE_SHARE
    norm.bias[places.any(dim=0)] = 0.0


def _fast_channels(dim: int, width: int) -> Tensor:
    """Rows that pick the channels in which the two-dimensional sinusoid turns fastest: half for rows, half for columns."""
    chosen = torch.zeros(width, dim)
    half = width // 2
    chosen[torch.arange(half), torch.arange(half)] = 1.0
    chosen[torch.arange(half, width), dim // 2 + torch.arange(width - half)] = 1.0
    return chosen
