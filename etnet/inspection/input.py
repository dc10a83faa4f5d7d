"""The exact input of the network: bins, the profile and the events of one pixel, the token grid and its padding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int8, Int64
from torch import Tensor

from etnet.inspection.mass import padding_shares
from etnet.nets.attention import TRAINED_TOKENS
from etnet.nets.base import Reconstructor
from etnet.nets.etnet import ETNet
from etnet.nets.padding import TokenGrid, pad_to_grid
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events
from etnet.voxel import MIN_EVENTS, bin_votes

RANGE_QUANTILE = 0.995
"""Of the absolute values that are not zero: where the shared signed range ends, so that a hot pixel does not rule."""


@dataclass(frozen=True, slots=True, eq=False)
class NetworkInput:
    """What the network got for one window, normalised if it wants that."""

    voxel: Float[Tensor, "bins h w"]
    padded: Float[Tensor, "bins hp wp"]
    """With the zeros around it that the first convolution sees."""
    grid: TokenGrid
    limit: float
    """Colours run from −limit to +limit in all bins; 0 for an empty window."""

    def profile(self, x: int, y: int) -> Float[Tensor, " bins"]:
        """The bins of one pixel."""
        return self.voxel[:, y, x]


def network_input(playback: Playback, index: int) -> NetworkInput:
    """The tensor of window `index`; on a branch with its edit applied."""
    voxel = playback.voxel(index)
    active = np.abs(voxel.numpy()[voxel.numpy() != 0])
    limit = float(np.quantile(active, RANGE_QUANTILE)) if active.size else 0.0
    return NetworkInput(voxel, pad_to_grid(voxel[None])[0], TokenGrid(*voxel.shape[-2:]), limit)


@dataclass(frozen=True, slots=True, eq=False)
class PixelEvents:
    """The events of one pixel in one window: a raster. `place` is 0 … bins − 1, between the bins it votes for."""

    t: Int64[np.ndarray, " n"]
    p: Int8[np.ndarray, " n"]
    place: Float64[np.ndarray, " n"]
    counts: bool
    """Whether they reached the network: a window of fewer than 3 events gives zeros."""


def pixel_events(playback: Playback, index: int, x: int, y: int) -> PixelEvents:
    """The events at pixel (x, y) that went into window `index`, as they were after an edit."""
    events = window_events(playback.recording, playback.windows[index], playback.edit_at(index))
    votes = bin_votes(events, playback.model.bins)
    here = (events.x == x) & (events.y == y)
    place = (votes.lower + votes.share)[here]
    return PixelEvents(events.t[here], events.p[here], place, len(events) >= MIN_EVENTS)


@dataclass(frozen=True, slots=True, eq=False)
class TokenMap:
    """The token grid over the padded frame."""

    grid: TokenGrid
    index: Int64[Tensor, "rows columns"]
    """The raster index, which a raster position code is made of."""
    padding: Float[Tensor, "rows columns"]
    """The share of each token that is padding."""
    seen: Bool[Tensor, "rows columns"] | None
    """Whether training met this position; `None` for a network without positions."""
    seen_source: str
    """Where that is known from, in words."""


def token_map(model: Reconstructor, height: int, width: int) -> TokenMap:
    """The tokens of a sensor, and which of their positions were met in training, as far as the card says."""
    grid = TokenGrid(height, width)
    index = torch.arange(grid.num_tokens).reshape(grid.rows, grid.columns)
    padding = padding_shares(grid).reshape(grid.rows, grid.columns)
    if not isinstance(model, ETNet):
        return TokenMap(grid, index, padding, None, f"{model.name} has no positions")
    row = torch.arange(grid.rows)[:, None].expand_as(index)
    column = torch.arange(grid.columns)[None].expand_as(index)
    is_raster = model.config.positions == "raster"
    context = _section(_section(model.card, "recipe"), "context")
    if "sensor_rows" in context and "sensor_columns" in context:
        rows, columns = (int(context[name][1]) for name in ("sensor_rows", "sensor_columns"))  # pyright: ignore
        seen = index < rows * columns if is_raster else (row < rows) & (column < columns)
        return TokenMap(grid, index, padding, seen, f"crops were placed on sensors of up to {columns} × {rows} tokens")
    side = round(TRAINED_TOKENS**0.5)
    seen = index < TRAINED_TOKENS if is_raster else (row < side) & (column < side)
    return TokenMap(grid, index, padding, seen, f"assumed: the card does not say; 112² crops show {side} × {side}")


def _section(card: Mapping[str, object], name: str) -> Mapping[str, object]:
    found = card.get(name)
    return found if isinstance(found, Mapping) else {}
