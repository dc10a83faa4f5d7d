"""Multi-head attention that can be watched: the fast path makes the output, rows are computed beside it on demand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import chain

import torch
from einops import rearrange
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import linear

from etnet.errors import ModelError
from etnet.nets.attention_kernels import KERNELS, log_normaliser
from etnet.nets.intervention import Intervention
from etnet.nets.padding import TokenGrid
from etnet.nets.storage import kept_alive

TRAINED_TOKENS = 196
"""Tokens of a 112² training crop: where `log_tokens` scaling leaves the logits as they are."""


@dataclass(frozen=True, slots=True)
class AttentionProbe:
    """Which attention sites to keep q and k of; `None` means all. Probing never changes the frame (law 1).

    `values` keeps v and the output projection too, for what a token is given and not only where it looks.
    """

    sites: frozenset[str] | None = None
    values: bool = False

    def wants(self, site: str) -> bool:
        """Whether this site is watched."""
        return self.sites is None or site in self.sites


@dataclass(frozen=True, slots=True)
class Attention:
    """q and k of the probed sites of one step (batch 1), from which any row or column of a map can be computed.

    `queries[site]`, `keys[site]`: "heads tokens d". `scales[site]` multiplies the logits (1/√d and, where the
    network has it, the scaling by the number of tokens). `values[site]` and `outputs[site]` (W_O of each head, so
    that a token receives Σ over heads and keys of α v W_O, and a bias) are there if the probe asked for values.
    """

    grid: TokenGrid
    queries: dict[str, Float[Tensor, "heads n d"]]
    keys: dict[str, Float[Tensor, "heads n d"]]
    scales: dict[str, float]
    values: dict[str, Float[Tensor, "heads n d"]] = field(default_factory=dict)
    outputs: dict[str, Float[Tensor, "heads d dim"]] = field(default_factory=dict)
    _normalisers: dict[str, Float[Tensor, "heads n"]] = field(default_factory=dict, repr=False, compare=False)

    @property
    def sites(self) -> tuple[str, ...]:
        """The probed sites in the order in which the network passes them."""
        return tuple(self.queries)

    @property
    def nbytes(self) -> int:
        """Bytes that it keeps alive: q and k are views of one product that holds v, too. W_O belongs to the network."""
        return kept_alive(chain(self.queries.values(), self.keys.values(), self.values.values()))

    def rows(self, site: str, tokens: Sequence[int]) -> Float[Tensor, "heads queries keys"]:
        """Where each of `tokens` looks: one distribution over all keys per head, softmax in fp32; rows sum to 1."""
        self._require(site)
        chosen = self.queries[site][:, list(tokens)].float()
        return torch.softmax(chosen @ self.keys[site].float().transpose(-1, -2) * self.scales[site], dim=-1)

    def columns(self, site: str, tokens: Sequence[int]) -> Float[Tensor, "heads queries keys"]:
        """Who looks at each of `tokens`: entry (h, i, j) is the weight that query i gives to key `tokens[j]`.

        Every query's softmax runs over all keys. A site's first column costs its whole map, in tiles; its sums are
        kept (4 bytes a query and head), so that every further one costs one product.
        """
        self._require(site)
        if site not in self._normalisers:
            self._normalisers[site] = log_normaliser(self.queries[site], self.keys[site], self.scales[site])
        chosen = self.keys[site][:, list(tokens)].float().transpose(-1, -2)
        logits = self.queries[site].float() @ chosen * self.scales[site]
        return (logits - self._normalisers[site][..., None]).exp()

    def _require(self, site: str) -> None:
        if site not in self.queries:
            known = ", ".join(self.queries) or "none"
            raise ModelError(f"attention site {site!r} was not probed; probed: {known}; name it in AttentionProbe")


@dataclass(slots=True)
class Observer:
    """Goes through one decode: collects what a probe wants and tells each site what an intervention changes."""

    probe: AttentionProbe | None
    intervention: Intervention
    queries: dict[str, Tensor] = field(default_factory=dict)
    keys: dict[str, Tensor] = field(default_factory=dict)
    scales: dict[str, float] = field(default_factory=dict)
    values: dict[str, Tensor] = field(default_factory=dict)
    outputs: dict[str, Tensor] = field(default_factory=dict)

    def record(self, site: str, query: Tensor, key: Tensor, value: Tensor, output: Tensor, scale: float) -> None:
        """Keep what the probe wants of a site: q, k, v ("1 heads n d") and W_O as torch holds it ("dim dim")."""
        if self.probe is None or not self.probe.wants(site):
            return
        if query.shape[0] != 1:
            raise ModelError(f"attention can be probed for a batch of 1, got {query.shape[0]}; step one at a time")
        self.queries[site], self.keys[site], self.scales[site] = query[0].detach(), key[0].detach(), scale
        if self.probe.values:
            self.values[site] = value[0].detach()
            self.outputs[site] = rearrange(output.detach(), "dim (h d) -> h d dim", h=query.shape[1])

    def attention(self, grid: TokenGrid) -> Attention | None:
        """What was collected; `None` when nobody asked."""
        if self.probe is None:
            return None
        return Attention(grid, self.queries, self.keys, self.scales, self.values, self.outputs)

    def is_uniform(self, site: str) -> bool:
        """Whether this site attends to every token alike."""
        return self.intervention.uniform_attention or site in self.intervention.uniform_sites

    def masked_heads(self, site: str) -> list[int]:
        """The heads of this site whose output is zero."""
        return sorted(head for name, head in self.intervention.masked_heads if name == site)


class MultiHeadAttention(nn.Module):
    """Scaled dot-product attention with one fused input projection (q, k, v in this order).

    `path` names one of `attention_kernels.KERNELS`. `scales_by_tokens` multiplies the logits by log N / log 196.
    """

    def __init__(self, dim: int, heads: int, site: str, scales_by_tokens: bool = False) -> None:
        super().__init__()
        self.heads = heads
        self.site = site
        self.scales_by_tokens = scales_by_tokens
        self.path = "fused"
        self.in_proj_weight = nn.Parameter(torch.empty(3 * dim, dim))
        self.in_proj_bias = nn.Parameter(torch.zeros(3 * dim))
        self.out_proj = nn.Linear(dim, dim)
        nn.init.xavier_uniform_(self.in_proj_weight)
        nn.init.zeros_(self.out_proj.bias)

    def forward(
        self, query: Float[Tensor, "b n c"], memory: Float[Tensor, "b m c"], observer: Observer
    ) -> Float[Tensor, "b n c"]:
        q, k, v = (rearrange(x, "b n (h d) -> b h n d", h=self.heads) for x in self._project(query, memory))
        scale = self._scale(q.shape[-1], k.shape[2])
        observer.record(self.site, q, k, v, self.out_proj.weight, scale)

        if observer.is_uniform(self.site):
            mixed = v.mean(2, keepdim=True).expand_as(q)
        else:
            mixed = KERNELS[self.path](q, k, v, scale)
        if masked := observer.masked_heads(self.site):
            mixed = mixed.index_fill(1, torch.tensor(masked, device=mixed.device), 0.0)

        return self.out_proj(rearrange(mixed, "b h n d -> b n (h d)"))

    def _project(self, query: Tensor, memory: Tensor) -> tuple[Tensor, ...]:
        if query is memory:
            return linear(query, self.in_proj_weight, self.in_proj_bias).chunk(3, dim=-1)
        dim = query.shape[-1]
        q = linear(query, self.in_proj_weight[:dim], self.in_proj_bias[:dim])
        return q, *linear(memory, self.in_proj_weight[dim:], self.in_proj_bias[dim:]).chunk(2, dim=-1)

    def _scale(self, head_dim: int, num_tokens: int) -> float:
        scale = 1 / math.sqrt(head_dim)
        if self.scales_by_tokens:
            scale *= math.log(max(num_tokens, 2)) / math.log(TRAINED_TOKENS)
        return scale
