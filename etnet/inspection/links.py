"""Where the strongest looks of one query token land, for lines in a scene."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.inspection.sites import sites_of
from etnet.nets.attention import Attention


@dataclass(frozen=True, slots=True)
class Link:
    """One look from the query token to `token`, whose middle is nearest to the sensor's pixel (x, y)."""

    scale: int
    token: int
    pixel: tuple[int, int]
    weight: float
    """The share of the query's attention, a mean over the heads and sites of its scale."""
    times_uniform: float
    """The weight as a multiple of what every token would get if all were read alike."""


def mean_row(attention: Attention, scale: int, token: int) -> Float[Tensor, " tokens"]:
    """What a token of one scale reads, the mean over all probed sites and heads of that scale; sums to 1."""
    names = [site.name for site in sites_of(attention) if site.scale == scale]
    return torch.stack([attention.rows(name, [token])[:, 0].mean(0) for name in names]).mean(0)


def strongest_links(attention: Attention, token: int, num_links: int = 12) -> tuple[Link, ...]:
    """The `num_links` strongest looks from `token` at each scale, scales from the coarsest, strongest first."""
    links: list[Link] = []
    for scale in sorted({site.scale for site in sites_of(attention)}, reverse=True):
        row = mean_row(attention, scale, token)
        weights, tokens = row.topk(min(num_links, len(row)))
        links += [
            Link(scale, landed, attention.grid.pixel_of(landed), weight, weight * len(row))
            for weight, landed in zip(weights.tolist(), tokens.tolist(), strict=True)
        ]
    return tuple(links)
