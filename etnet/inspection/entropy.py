"""What one attention map amounts to in numbers: its peak, how many tokens it reads, how far away they lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.padding import PATCH, TokenGrid

HeadChoice = int | Literal["mean", "max", "min"]


@dataclass(frozen=True, slots=True, eq=False)
class MapNumbers:
    """One number for each head and query of `rows`. Each map is taken as a distribution (divided by its sum)."""

    peak_token: Int64[Tensor, "heads queries"]
    """The token that gets most; the first of equals."""
    peak: Float[Tensor, "heads queries"]
    """What it gets."""
    entropy: Float[Tensor, "heads queries"]
    """Bits: 0 where one token gets all, log₂ of the number of tokens where all get alike."""
    distance: Float[Tensor, "heads queries"]
    """Mean distance in pixels from the query token's middle to the middles of what it reads."""

    @property
    def tokens_read(self) -> Float[Tensor, "heads queries"]:
        """2^entropy, the perplexity: as many tokens read alike would have this entropy ("reads ≈ 37 tokens")."""
        return torch.exp2(self.entropy)


def map_numbers(rows: Float[Tensor, "heads queries keys"], grid: TokenGrid, query_tokens: Sequence[int]) -> MapNumbers:
    """Peak, entropy and mean distance of each map; `query_tokens` are the tokens that the rows belong to."""
    share = rows / rows.sum(-1, keepdim=True)
    peak, peak_token = share.max(-1)
    middles = token_middles(grid).to(rows)
    apart = torch.cdist(middles[list(query_tokens)], middles)
    return MapNumbers(peak_token, peak, entropy_bits(share), (share * apart).sum(-1))


@dataclass(frozen=True, slots=True, eq=False)
class HeadEntropies:
    """Two numbers for all heads of a site together, bits. They differ: heads that look at different places have a
    broad mean map, however sharp each of them is.
    """

    of_mean_map: Float[Tensor, " queries"]
    """The entropy of the mean of the heads' maps: that of the map that `choose_head(rows, "mean")` gives."""
    mean_of_heads: Float[Tensor, " queries"]
    """The mean of the heads' own entropies: how sharp a head is on average. Never above `of_mean_map`."""


def head_entropies(rows: Float[Tensor, "heads queries keys"]) -> HeadEntropies:
    """Both entropies of each query."""
    together = choose_head(rows, "mean")
    share, share_together = (maps / maps.sum(-1, keepdim=True) for maps in (rows, together))
    return HeadEntropies(entropy_bits(share_together), entropy_bits(share).mean(0))


def entropy_bits(share: Float[Tensor, "*axes keys"]) -> Float[Tensor, "*axes"]:
    """−Σ p log₂ p along the last axis; a zero adds nothing."""
    return -torch.special.xlogy(share, share).sum(-1) / torch.log(torch.tensor(2.0))


def token_middles(grid: TokenGrid) -> Float[Tensor, "tokens 2"]:
    """The middle of each token on the sensor, (x, y) in pixels; those on the border may lie outside it."""
    row, column = torch.meshgrid(torch.arange(grid.rows), torch.arange(grid.columns), indexing="ij")
    middles = torch.stack((column * PATCH - grid.left, row * PATCH - grid.top), dim=-1)
    return (middles + (PATCH - 1) / 2).reshape(-1, 2)


def choose_head(rows: Float[Tensor, "heads *axes keys"], head: HeadChoice = "mean") -> Float[Tensor, "*axes keys"]:
    """One head, or the mean, the largest or the smallest over heads, token by token (these two need not sum to 1)."""
    if isinstance(head, int):
        if not 0 <= head < len(rows):
            raise ModelError(f"head {head} of {len(rows)}; heads are counted from 0")
        return rows[head]
    if head == "mean":
        return rows.mean(0)
    return rows.amax(0) if head == "max" else rows.amin(0)
