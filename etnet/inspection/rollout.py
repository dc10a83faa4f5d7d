"""Attention rollout (Abnar & Zuidema 2020) through TPA for one query: a vector times matrices, never a matrix.

The definition stands in `docs/inspect.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.errors import Cancelled, ModelError
from etnet.inspection.entropy import HeadChoice, choose_head
from etnet.inspection.sites import Site, sites_of
from etnet.nets.attention import Attention
from etnet.nets.padding import TokenGrid

TILE = 128
"""Queries whose rows are in memory at a time: heads × tile × tokens numbers."""


@dataclass(frozen=True, slots=True, eq=False)
class Rollout:
    """How much each token that enters TPA, scale by scale, takes part in one token that leaves it; sums to 1."""

    token: int
    scales: tuple[int, ...]
    """From the coarsest; the first axis of `weights`."""
    weights: Float[Tensor, "scales tokens"]
    grid: TokenGrid

    @property
    def by_scale(self) -> Float[Tensor, " scales"]:
        """How much of it comes in through each scale."""
        return self.weights.sum(-1)

    @property
    def total(self) -> Float[Tensor, " tokens"]:
        """All scales together."""
        return self.weights.sum(0)


@dataclass(frozen=True, slots=True)
class _Stack:
    """The layers of one scale, each in the order in which the network passes them."""

    encoders: tuple[Site, ...]
    decoders: tuple[tuple[Site, Site], ...]


def rollout(
    attention: Attention,
    token: int,
    discard: float = 0.0,
    tile: int = TILE,
    fusion: HeadChoice = "mean",
    cancelled: Callable[[], bool] | None = None,
) -> Rollout:
    """Roll attention out from `token` of the aggregated tokens back to the tokens that each scale puts in.

    `discard` drops the smallest share of each token's weights before they are used, the rest is scaled to sum to 1.
    `fusion` makes one map of a site's heads: their mean, their largest or smallest weight, or one head by its index.
    All sites must have been probed. Costs about as much as a decode; `cancelled` is asked before every tile and ends
    the work with `Cancelled`.
    """
    if not 0 <= discard < 1:
        raise ValueError(f"discard is {discard}; it is the share of weights to drop, 0 up to below 1")
    stacks = _stacks(attention)
    scales = tuple(stacks)

    def through(site: Site, mass: Tensor) -> Float[Tensor, " tokens"]:
        """massᵀ A, in tiles of the queries that carry any mass."""
        result = torch.zeros_like(mass)
        for queries in mass.nonzero()[:, 0].split(tile):
            if cancelled is not None and cancelled():
                raise Cancelled("this rollout is no longer wanted")
            result += mass[queries] @ fused_rows(attention, site.name, queries.tolist(), discard, fusion).to(mass)
        return result

    num_tokens = attention.grid.num_tokens
    start = torch.zeros(num_tokens)
    start[token] = 1 / sum(1 + bool(stack.decoders) for stack in stacks.values())

    leaving = {scale: start.clone() for scale in scales}  # mass on each encoder's output; its own stream is in the mean
    for scale, stack in stacks.items():
        if not stack.decoders:
            continue
        own, memory = start, torch.zeros(num_tokens)
        for attend, read in reversed(stack.decoders):
            memory = memory + through(read, own) / 2
            own = own / 2
            own = (own + through(attend, own)) / 2
        leaving[scale] = leaving[scale] + own
        coarser = stack.decoders[0][1].reads(scales[0])
        leaving[coarser] = leaving[coarser] + memory

    entering = []
    for scale, stack in stacks.items():
        mass = leaving[scale]
        for site in reversed(stack.encoders):
            mass = (mass + through(site, mass)) / 2
        entering.append(mass)
    return Rollout(token, scales, torch.stack(entering), attention.grid)


def fused_rows(
    attention: Attention, site: str, tokens: list[int], discard: float = 0.0, fusion: HeadChoice = "mean"
) -> Float[Tensor, "queries keys"]:
    """One map of a site's heads for some queries, without the smallest `discard` of each row's weights.

    Rows sum to 1: they are scaled to where heads are not averaged or weights were dropped. A row whose smallest
    weights are all 0 is that of the mean.
    """
    by_head = attention.rows(site, tokens)
    rows = choose_head(by_head, fusion)
    if fusion == "min":
        rows = torch.where(rows.sum(-1, keepdim=True) > 0, rows, by_head.mean(0))
    num_dropped = int(discard * rows.shape[-1])
    if num_dropped:
        smallest = rows.topk(num_dropped, largest=False).indices
        rows = rows.scatter(-1, smallest, 0.0)
    return rows / rows.sum(-1, keepdim=True) if num_dropped or fusion in ("min", "max") else rows


def _stacks(attention: Attention) -> dict[int, _Stack]:
    """Layers by scale, from the coarsest; refuses a probe that left some out."""
    sites = sites_of(attention)
    stacks: dict[int, _Stack] = {}
    for scale in sorted({site.scale for site in sites}, reverse=True):
        here = [site for site in sites if site.scale == scale]
        encoders = tuple(site for site in here if site.part == "encoder")
        attends = [site for site in here if site.part == "decoder" and site.kind == "self"]
        reads = [site for site in here if site.kind == "cross"]
        if len(attends) != len(reads):
            raise _incomplete()
        stacks[scale] = _Stack(encoders, tuple(zip(attends, reads, strict=True)))
    depths = {(len(stack.encoders), len(stack.decoders)) for stack in stacks.values()}
    gaps = any(site.layer >= len(stack.encoders) for stack in stacks.values() for site in stack.encoders)
    if len(depths) != 1 or gaps or not stacks[max(stacks)].encoders or max(stacks) - min(stacks) + 1 != len(stacks):
        raise _incomplete()
    return stacks


def _incomplete() -> ModelError:
    return ModelError("rollout needs every attention site; probe with AttentionProbe() and name no sites")
