"""One moment's map held against another's: a pin keeps its window and its run, and two pins have a difference."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.inspection.anatomy import require
from etnet.inspection.entropy import HeadChoice, choose_head
from etnet.inspection.sites import Direction, Site
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.padding import TokenGrid
from etnet.playback.playback import Playback

FLOOR = 1 / 64
"""Of the uniform weight: both maps are raised to it before they are divided, so that two zeros are equal."""
LIMIT_QUANTILE = 0.99
"""Of |log₂ ratio|: where the shared range of colours ends, so that one token does not make all others black."""


@dataclass(frozen=True, slots=True, eq=False)
class Pin:
    """One token's map in one window of one run, and all that names it."""

    recording: str
    model: str
    index: int
    t: int
    """The frame's stamp, µs."""
    pixel: tuple[int, int]
    site: str
    head: HeadChoice
    direction: Direction
    map: Float[Tensor, " tokens"]
    frame: Float[Tensor, "h w"]
    """The frame below it, raw."""
    grid: TokenGrid

    @property
    def token(self) -> int:
        """The token over the pixel."""
        return self.grid.token_at(*self.pixel)

    @property
    def times_uniform(self) -> Float[Tensor, " tokens"]:
        """The map as a multiple of the weight that every token would get if all were alike, 1 / tokens."""
        return self.map * len(self.map)

    def __str__(self) -> str:
        """What it shows, in words."""
        head = f"head {self.head}" if isinstance(self.head, int) else f"{self.head} of the heads"
        return f"{self.model} · {self.recording} · window {self.index} · {self.site}, {head}, {self.direction}"


def pin(
    playback: Playback,
    index: int,
    pixel: tuple[int, int],
    site: str,
    head: HeadChoice = "mean",
    direction: Direction = "attends to",
    intervention: Intervention = ORIGINAL,
    cancelled: Callable[[], bool] | None = None,
) -> Pin:
    """Hold the map of the token over pixel (x, y): one decode that is observed. Columns cost the whole map."""
    require(playback.model, "attention")
    Site.of(site)
    step = playback.at(index, AttentionProbe(frozenset({site})), intervention, cancelled)
    attention = step.attention
    if attention is None or site not in attention.queries:
        raise ModelError(f"{playback.model.name} has no attention site {site!r}")
    token = attention.grid.token_at(*pixel)
    if direction == "attends to":
        by_head = attention.rows(site, [token])[:, 0]
    else:
        by_head = attention.columns(site, [token])[..., 0]
    return Pin(
        playback.recording.name,
        playback.model.name,
        index,
        playback.windows[index].t_stop,
        pixel,
        site,
        head,
        direction,
        choose_head(by_head, head).clone().cpu(),  # a copy, so that a pin does not hold on to every head
        step.frame[0, 0].clone().cpu(),
        attention.grid,
    )


@dataclass(frozen=True, slots=True, eq=False)
class MapDifference:
    """Now − then, token by token."""

    now: Pin
    then: Pin
    difference: Float[Tensor, " tokens"]
    log_ratio: Float[Tensor, " tokens"]
    """log₂(now / then), signed: +1 is twice the weight, −1 half. Weights below the floor count as the floor."""
    floor: float
    """The smallest weight that counts."""
    limit: float
    """A range −limit … +limit for colours; a few tokens lie beyond and are drawn as "≥"."""

    @property
    def num_clipped(self) -> int:
        """How many tokens lie beyond the limit."""
        return int((self.log_ratio.abs() > self.limit).sum())


def difference(now: Pin, then: Pin, floor: float = FLOOR) -> MapDifference:
    """Two maps on one token grid: two windows of a run, two networks on one recording, two heads or sites."""
    if now.grid != then.grid:
        raise ModelError(
            f"the maps lie on {now.grid.columns} × {now.grid.rows} and {then.grid.columns} × {then.grid.rows} tokens; "
            "take two of the same sensor size"
        )
    if not floor > 0:
        raise ValueError(f"floor is {floor}; it is a share of the uniform weight, above 0")
    least = floor / len(now.map)
    ratio = torch.log2(now.map.clamp_min(least)) - torch.log2(then.map.clamp_min(least))
    limit = float(torch.quantile(ratio.abs(), LIMIT_QUANTILE))
    return MapDifference(now, then, now.map - then.map, ratio, least, limit)


def difference_csv(found: MapDifference) -> str:
    """Two maps as text, one line a token: its place, both weights in full, log₂ of their ratio above the floor."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(("token", "row", "column", "x", "y", "now", "then", "log2_ratio"))
    grid = found.now.grid
    values = zip(found.now.map.tolist(), found.then.map.tolist(), found.log_ratio.tolist(), strict=True)
    for token, (now, then, ratio) in enumerate(values):
        place = *divmod(token, grid.columns), *grid.pixel_of(token)
        table.writerow((token, *place, repr(now), repr(then), f"{ratio:.6g}"))
    return text.getvalue()
