"""Is every part of the network alive, and does attention look anywhere? Measured on one decode."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from etnet.nets.attention import Attention
from etnet.nets.base import Pyramid
from etnet.nets.etnet import ETNet

NUM_QUERIES = 64
"""Queries whose rows are compared at each site."""


@dataclass(frozen=True, slots=True)
class Health:
    """By upsampler (coarse to fine): share of units that fire anywhere, and of outputs above zero. RMS by branch.

    By attention site: mean cosine between the rows of different queries (1: all look alike) and the share of all
    tokens that a row reads, e^entropy / N (1: uniform).
    """

    live_units: dict[str, float]
    positive_outputs: dict[str, float]
    rms: dict[str, float]
    cosine: dict[str, float]
    spread: dict[str, float]

    def numbers(self) -> dict[str, dict[str, float]]:
        """For the log."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @staticmethod
    def mean(several: Sequence[Health]) -> Health:
        """The mean of each number."""
        columns = [
            {key: float(np.mean([getattr(one, name)[key] for one in several])) for key in getattr(several[0], name)}
            for name in Health.__dataclass_fields__
        ]
        return Health(*columns)


@dataclass(slots=True)
class Watch:
    """Collects what passes through a network's branches while it is installed."""

    outputs: dict[str, Tensor] = field(default_factory=dict)

    def health(self, pyramid: Pyramid, attention: Attention) -> Health:
        """What the collected outputs and the attention of one decode say."""
        upsamplers = {name: value for name, value in self.outputs.items() if name.startswith("upsampler")}
        rms = {name: _rms(value) for name, value in self.outputs.items()}
        rms |= {f"skip{index}": _rms(level) for index, level in enumerate(pyramid.levels)}
        rows = {site: attention.rows(site, _queries(attention)) for site in attention.sites}
        return Health(
            live_units={
                name: float((value > 0).any(0).flatten(1).any(1).float().mean()) for name, value in upsamplers.items()
            },
            positive_outputs={name: float((value > 0).float().mean()) for name, value in upsamplers.items()},
            rms=rms,
            cosine={site: mean_cosine(row) for site, row in rows.items()},
            spread={site: mean_spread(row) for site, row in rows.items()},
        )


@contextmanager
def health_of(model: ETNet) -> Iterator[Watch]:
    """Watch a network's branches; it computes the same with and without."""
    watch = Watch()

    def keep(name: str):
        def hook(module: nn.Module, inputs: object, output: Tensor) -> None:
            watch.outputs[name] = output.detach()

        return hook

    handles = [model.tpa.register_forward_hook(keep("tpa"))]
    handles += [block.register_forward_hook(keep(f"upsampler{i}")) for i, block in enumerate(model.upsampler)]
    try:
        yield watch
    finally:
        for handle in handles:
            handle.remove()


def mean_cosine(rows: Float[Tensor, "heads queries keys"]) -> float:
    """Mean cosine between the rows of different queries, over heads."""
    unit = rows / rows.norm(dim=-1, keepdim=True)
    count = rows.shape[1]
    return float((unit.sum(1).square().sum(-1) - count).mean() / (count * (count - 1)))


def mean_spread(rows: Float[Tensor, "heads queries keys"]) -> float:
    """e^entropy of the rows as a share of all keys, the mean over heads and queries."""
    entropy = -(rows * rows.clamp_min(1e-20).log()).sum(-1)
    return float(entropy.exp().mean() / rows.shape[-1])


def _queries(attention: Attention) -> list[int]:
    count = attention.grid.num_tokens
    return torch.linspace(0, count - 1, min(NUM_QUERIES, count)).long().unique().tolist()


def _rms(value: Tensor) -> float:
    return float(value.float().square().mean().sqrt())
