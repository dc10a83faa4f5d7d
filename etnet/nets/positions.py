"""Positional codes for token grids of any size (paper, eq. 3)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Float, Int64
from torch import Tensor


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a token grid lies on an imagined larger sensor, in tokens.

    A training crop is told a random place so that the weights meet the positions of full sensors; at inference
    the grid starts at the origin and is its own sensor. `stride` is the imagined sensor's number of columns.
    """

    row: int = 0
    column: int = 0
    stride: int | None = None


ORIGIN = Placement()


def sinusoid(index: Int64[Tensor, " n"], dim: int) -> Float[Tensor, "n dim"]:
    """Even columns sin, odd columns cos, of index / 10000^(2⌊j/2⌋/dim) (Vaswani et al. 2017, §3.5)."""
    exponent = 2 * (torch.arange(dim, dtype=torch.float64) // 2) / dim
    angle = index.double()[:, None] / 10_000**exponent
    return torch.where(torch.arange(dim) % 2 == 0, angle.sin(), angle.cos()).float()


@lru_cache(maxsize=32)
def raster_positions(rows: int, columns: int, dim: int, placement: Placement = ORIGIN) -> Float[Tensor, "n dim"]:
    """One sinusoid over the flat raster index, as the paper and the released code have it."""
    row = torch.arange(placement.row, placement.row + rows)[:, None]
    column = torch.arange(placement.column, placement.column + columns)[None, :]
    return sinusoid((row * (placement.stride or columns) + column).flatten(), dim)


@lru_cache(maxsize=32)
def grid_positions(rows: int, columns: int, dim: int, placement: Placement = ORIGIN) -> Float[Tensor, "n dim"]:
    """A sinusoid of the row beside a sinusoid of the column, half the channels each: independent of the width."""
    row = sinusoid(torch.arange(placement.row, placement.row + rows), dim // 2)
    column = sinusoid(torch.arange(placement.column, placement.column + columns), dim // 2)
    both = torch.cat((row[:, None].expand(-1, columns, -1), column[None].expand(rows, -1, -1)), dim=-1)
    return both.reshape(rows * columns, dim)
