"""Where attention goes to waste, or only seems to go: padding, sinks, and tokens whose values are small."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.attention import Attention
from etnet.nets.padding import PATCH, TokenGrid

SINK_FACTOR = 4.0
"""A token is a sink for a query that gives it this many times the uniform weight, if nearly all queries do."""
SINK_SHARE = 0.9
"""Nearly all: this share of the queries."""


@dataclass(frozen=True, slots=True)
class Region:
    """A rectangle of sensor pixels, half open: x in x_start … x_stop − 1, y in y_start … y_stop − 1."""

    x_start: int
    y_start: int
    x_stop: int
    y_stop: int

    def __post_init__(self) -> None:
        if self.x_start >= self.x_stop or self.y_start >= self.y_stop:
            raise ValueError(f"{self} holds no pixel; wanted x_start < x_stop and y_start < y_stop")

    @staticmethod
    def around(pixel: tuple[int, int], near: int) -> Region:
        """A square: `near` pixels to each side of a pixel (x, y). What lies outside the sensor holds no attention."""
        x, y = pixel
        return Region(x - near, y - near, x + near + 1, y + near + 1)

    @staticmethod
    def whole(grid: TokenGrid) -> Region:
        """All pixels of the sensor."""
        return Region(0, 0, grid.width, grid.height)


def region_shares(grid: TokenGrid, region: Region) -> Float[Tensor, " tokens"]:
    """The share of each token's area that lies in `region`. Shares of disjoint regions add up."""
    rows = _overlap(grid.rows, grid.top, region.y_start, region.y_stop)
    columns = _overlap(grid.columns, grid.left, region.x_start, region.x_stop)
    return (rows[:, None] * columns[None, :]).flatten()


def padding_shares(grid: TokenGrid) -> Float[Tensor, " tokens"]:
    """The share of each token's area that is zero padding around the sensor."""
    return 1 - region_shares(grid, Region.whole(grid))


def mass_on(rows: Float[Tensor, "*axes tokens"], shares: Float[Tensor, " tokens"]) -> Float[Tensor, "*axes"]:
    """How much of each row falls on an area: every token counts with the share of it that lies there."""
    return rows @ shares.to(rows)


@dataclass(frozen=True, slots=True, eq=False)
class Received:
    """What every token gets from all queries of one site."""

    site: str
    times_uniform: Float[Tensor, "heads tokens"]
    """The mean weight over all queries, times the number of tokens: 1 where attention is uniform; its mean is 1."""
    share_above: Float[Tensor, "heads tokens"]
    """The share of queries that give the token at least `factor` × uniform."""
    factor: float = SINK_FACTOR

    def sinks(self, least_share: float = SINK_SHARE) -> Bool[Tensor, "heads tokens"]:
        """Tokens that nearly all queries look at, whatever they are."""
        return self.share_above >= least_share


def received(attention: Attention, site: str, factor: float = SINK_FACTOR, tile: int = 256) -> Received:
    """Go through the whole map of a site, `tile` queries at a time."""
    num_queries, total, above = _num_queries(attention, site), 0.0, 0.0
    for start in range(0, num_queries, tile):
        rows = attention.rows(site, range(start, min(start + tile, num_queries)))
        total = total + rows.sum(1)
        above = above + (rows * rows.shape[-1] >= factor).float().sum(1)
    assert isinstance(total, Tensor)
    assert isinstance(above, Tensor)
    return Received(site, total / num_queries * total.shape[-1], above / num_queries, factor)


@dataclass(frozen=True, slots=True, eq=False)
class ValueWeighted:
    """Attention weighed by what the read tokens hand over (Kobayashi et al. 2020). Not a distribution."""

    by_head: Float[Tensor, "heads queries keys"]
    """‖α v W_O‖ of each head."""
    joint: Float[Tensor, "queries keys"]
    """‖Σ over heads of α v W_O‖: what one token hands over in all, where heads may cancel."""


def value_weighted(attention: Attention, site: str, tokens: Sequence[int]) -> ValueWeighted:
    """Rows of ‖αvW_O‖ for `tokens`; needs `AttentionProbe(values=True)`."""
    _num_queries(attention, site)
    if site not in attention.values:
        raise ModelError(f"{site}: its values were not kept; probe with AttentionProbe(values=True)")
    rows = attention.rows(site, tokens)
    # Norms need W_O W_Oᵀ alone: heads × heads × d × d numbers in place of a vector of `dim` for each key.
    outputs, values = attention.outputs[site].float(), attention.values[site].float()
    gram = torch.einsum("hdo,geo->hgde", outputs, outputs)
    own = torch.einsum("hkd,hde,hke->hk", values, torch.diagonal(gram).permute(2, 0, 1), values)
    joint = []
    for row in rows.unbind(1):  # "heads keys"
        given = row[..., None] * values
        mixed = torch.einsum("hkd,hgde->gke", given, gram)
        joint.append((mixed * given).sum((0, 2)).clamp_min(0).sqrt())
    return ValueWeighted(rows * own.clamp_min(0).sqrt()[:, None], torch.stack(joint))


def _num_queries(attention: Attention, site: str) -> int:
    if site not in attention.queries:
        known = ", ".join(attention.sites) or "none"
        raise ModelError(f"attention site {site!r} was not probed; probed: {known}; name it in AttentionProbe")
    return attention.queries[site].shape[1]


def _overlap(num_tokens: int, border: int, start: int, stop: int) -> Float[Tensor, " n"]:
    """The share of each token's side that lies in pixels start … stop − 1."""
    begin = torch.arange(num_tokens) * PATCH - border
    covered = (begin + PATCH).clamp(max=stop) - begin.clamp(min=start)
    return covered.clamp(min=0) / PATCH
