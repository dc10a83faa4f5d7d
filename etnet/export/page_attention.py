"""Attention for a page: a small map for each pixel of a grid and each of a few sites, all of a moment in one image."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from etnet.events.events import Sensor
from etnet.nets.attention import Attention
from etnet.nets.padding import PATCH, TokenGrid
from etnet.render.attention import HIGHEST, LOWEST, level_overlay, times_uniform, tokens_read
from etnet.render.encode import webp

LEVELS = 24
"""Steps of the logarithmic range in a page's maps: fewer make smaller files."""
ENDS = (1.25, 1.5, 2.0, 4.0, 8.0, 16.0, HIGHEST)
"""× uniform at which the range may end."""
DOWN = math.log(LOWEST) / math.log(HIGHEST)
"""The range begins at its end to this power, so that 1 × has the same level in all of them."""
PERCENTILE = 99.5
"""Of a moment's weights: where the range ends."""


def query_pixels(sensor: Sensor, grid: tuple[int, int]) -> tuple[tuple[int, int], ...]:
    """The middles of `grid` (columns, rows) equal parts of the sensor, row by row."""
    columns, rows = min(grid[0], sensor.width), min(grid[1], sensor.height)
    xs = [int((i + 0.5) * sensor.width / columns) for i in range(columns)]
    ys = [int((i + 0.5) * sensor.height / rows) for i in range(rows)]
    return tuple((x, y) for y in ys for x in xs)


def chosen_sites(sites: Sequence[str]) -> tuple[str, ...]:
    """Of each scale, coarsest first: the last encoder's self-attention and the last decoder's cross-attention."""
    chosen: list[str] = []
    for scale in sorted({site.split(".")[0] for site in sites}, reverse=True):
        for part, kind in (("encoder", "self"), ("decoder", "cross")):
            fitting = [s for s in sites if s.startswith(f"{scale}.{part}.") and s.endswith(f".{kind}")]
            chosen += fitting[-1:]
    return tuple(chosen)


@dataclass
class AttentionSheets:
    """Maps of every moment for a grid of `queries`, kept in a byte a token until the range of all of them is known.

    A network without attention leaves all of it empty.
    """

    queries: tuple[tuple[int, int], ...]
    sites: tuple[str, ...] = ()
    grid: TokenGrid | None = None
    _levels: list[UInt8[np.ndarray, "sites queries keys"]] = field(default_factory=list)
    _read: list[list[int]] = field(default_factory=list)

    def add(self, attention: Attention | None) -> None:
        """Take one moment's rows in, the mean of all heads."""
        if attention is None or not attention.sites:
            return
        self.grid, self.sites = attention.grid, chosen_sites(attention.sites)
        tokens = [attention.grid.token_at(x, y) for x, y in self.queries]
        rows = np.stack([attention.rows(site, tokens).mean(dim=0).cpu().numpy() for site in self.sites])
        self._levels.append(_to_bytes(times_uniform(rows)))
        self._read.append(np.rint(tokens_read(rows)).astype(int).ravel().tolist())

    def encoded(self, most_bytes: float) -> tuple[list[bytes], dict[str, Any] | None]:
        """Images of as many moments, evenly spread, as fit in `most_bytes`, and what a page needs to know of them.

        In an image the sites stand below one another, a row of maps each, a map a query from left to right.
        """
        if self.grid is None:
            return [], None
        highest = self._highest()
        sheets = [self._sheet(levels, highest) for levels in self._levels]
        strides = (n for n in range(1, len(sheets)) if sum(map(len, sheets[::n])) <= most_bytes)
        stride = next(strides, max(len(sheets), 1))
        grid = self.grid
        facts = {
            "queries": self.queries,
            "stride": stride,
            "sites": [_site_facts(site) for site in self.sites],
            "rows": grid.rows,
            "columns": grid.columns,
            "top": grid.top,
            "left": grid.left,
            "patch": PATCH,
            "range": [highest**DOWN, highest],
            "read": self._read[::stride],
        }
        return sheets[::stride], facts

    def _highest(self) -> float:
        """× uniform at which the colours end: networks differ, from almost alike everywhere to a few tokens."""
        peaks = [np.percentile(levels, PERCENTILE) for levels in self._levels]
        peak = float(_from_bytes(np.float64(np.percentile(peaks, 90))))
        return next((end for end in ENDS if end >= peak), ENDS[-1])

    def _sheet(self, levels: UInt8[np.ndarray, "sites queries keys"], highest: float) -> bytes:
        assert self.grid is not None
        lowest = highest**DOWN
        level = (np.log(_from_bytes(levels) / lowest) / math.log(highest / lowest)).clip(0, 1)
        level = np.rint(level * (LEVELS - 1)) / (LEVELS - 1)
        maps = level_overlay(level.reshape(*levels.shape[:2], self.grid.rows, self.grid.columns))
        return webp(np.concatenate([np.concatenate(list(of), axis=1) for of in maps], axis=0), None)


def _to_bytes(relative: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape"]:
    """× uniform from 1/16 to 64, logarithmically."""
    return np.rint((np.log2(np.maximum(relative, 1 / 16)) + 4) * 25.5).clip(0, 255).astype(np.uint8)


def _from_bytes(levels: np.ndarray | np.float64) -> np.ndarray:
    return np.exp2(levels / 25.5 - 4)


def _site_facts(site: str) -> dict[str, Any]:
    scale, _, _, kind = site.split(".")
    return {"name": site, "scale": int(scale.removeprefix("scale")), "isCross": kind == "cross"}
