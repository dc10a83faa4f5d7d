"""The part of a map that holds most: by mass, by number of tokens; and a row as a table."""

from __future__ import annotations

import csv
import io

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from etnet.nets.padding import TokenGrid


def holding(row: Float[Tensor, "*axes tokens"], mass: float) -> Bool[Tensor, "*axes tokens"]:
    """The fewest tokens that hold at least the share `mass` of a map, strongest first; of equals the earlier token."""
    if not 0 < mass <= 1:
        raise ValueError(f"mass is {mass}; it is a share of the map, above 0 up to 1")
    weights, order = row.double().sort(dim=-1, descending=True, stable=True)
    # What the stronger ones hold already; a token is needed while that falls short.
    before = weights.cumsum(-1) - weights
    needed = before < mass * weights.sum(-1, keepdim=True) * (1 - 1e-12)
    needed[..., 0] = True
    return torch.zeros_like(row, dtype=torch.bool).scatter(-1, order, needed)


def strongest(row: Float[Tensor, "*axes tokens"], count: int) -> Bool[Tensor, "*axes tokens"]:
    """The `count` tokens of the largest weight; of equals the earlier."""
    if count < 1:
        raise ValueError(f"count is {count}; at least 1 token is kept")
    order = row.sort(dim=-1, descending=True, stable=True).indices[..., :count]
    return torch.zeros_like(row, dtype=torch.bool).scatter(-1, order, True)


def row_csv(row: Float[Tensor, " tokens"], grid: TokenGrid) -> str:
    """A map as text, one line a token: its place, the sensor pixel nearest to its middle, its weight in full."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("token", "row", "column", "x", "y", "weight", "times_uniform"))
    mean = float(row.double().mean())
    for token, weight in enumerate(row.tolist()):
        times = weight / mean if mean else 0.0
        table.writerow((token, *divmod(token, grid.columns), *grid.pixel_of(token), repr(weight), f"{times:.6g}"))
    return text.getvalue()
