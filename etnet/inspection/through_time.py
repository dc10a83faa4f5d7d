"""One query followed through time: where its attention lies, how sharp it is, and how the state's norms run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from etnet.errors import Cancelled, ModelError
from etnet.inspection.anatomy import require
from etnet.inspection.entropy import HeadChoice, choose_head, entropy_bits
from etnet.inspection.gates import LevelNorms, level_norms
from etnet.inspection.mass import Region, mass_on, region_shares
from etnet.nets.attention import AttentionProbe
from etnet.playback.playback import Playback


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The pinned query in one window. The axis of heads has length 1 where a head, or their mean, was chosen.

    `along_row` and `along_column` are attention on the query's own token row and column: one line of a kymograph.
    """

    index: int
    t: int
    """The frame's stamp, µs."""
    pixel: tuple[int, int]
    """Where the query lay in this window: it moves if a path was followed."""
    sites: tuple[str, ...]
    mass: Float[Tensor, "sites heads"]
    """Attention on the region."""
    entropy: Float[Tensor, "sites heads"]
    """Bits, of each map of the axis of heads: of a chosen "mean" it is the mean map's, not the heads' mean entropy."""
    along_row: Float[Tensor, "sites heads columns"]
    along_column: Float[Tensor, "sites heads rows"]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Moments put together, in the order in which they came."""

    index: Int64[Tensor, " windows"]
    t: Int64[Tensor, " windows"]
    pixels: Int64[Tensor, "windows 2"]
    sites: tuple[str, ...]
    mass: Float[Tensor, "windows sites heads"]
    entropy: Float[Tensor, "windows sites heads"]
    along_row: Float[Tensor, "windows sites heads columns"]
    """A kymograph is `along_row[:, site].mean(1)`: "windows columns"."""
    along_column: Float[Tensor, "windows sites heads rows"]

    @staticmethod
    def of(moments: Iterable[Moment]) -> Track:
        """Stack at least one moment."""
        held = list(moments)
        if not held:
            raise ValueError("a track is made of at least one moment; none was given")
        stacked = [
            torch.stack([getattr(moment, name) for moment in held])
            for name in ("mass", "entropy", "along_row", "along_column")
        ]
        index, t = (torch.tensor([getattr(moment, name) for moment in held]) for name in ("index", "t"))
        pixels = torch.tensor([moment.pixel for moment in held])
        return Track(index, t, pixels, held[0].sites, *stacked)


def attention_through_time(
    playback: Playback,
    query: tuple[int, int] | Mapping[int, tuple[int, int]],
    indices: Sequence[int],
    sites: frozenset[str] | None = None,
    region: Region | None = None,
    cancelled: Callable[[], bool] | None = None,
    head: HeadChoice | None = None,
    near: int | None = None,
) -> Iterator[Moment]:
    """The query pixel (x, y) in each of the windows `indices`, one decode each; ascending indices replay least.

    `query` is one pixel or, of a patch that is followed, a pixel for each index (`follow.pixels_of`). `sites` are all
    by default. `region` is the whole sensor by default, so that `mass` is what does not lie on padding; it moves with
    no path. `near` takes, in its place, so many pixels to each side of the query, wherever that lies. `head` chooses
    one map of the heads, taken as a distribution; without it every head is kept apart. `cancelled` is asked before
    every window and between replayed steps, and ends the work with `Cancelled`.
    """
    require(playback.model, "attention")
    if near is not None and (region is not None or near < 0):
        raise ValueError(f"near is {near} and region {region}; give pixels around the query (0 or more) or a region")
    for index in indices:
        if cancelled is not None and cancelled():
            raise Cancelled("this track is no longer wanted")
        attention = playback.at(index, AttentionProbe(sites), cancelled=cancelled).attention
        if attention is None or not attention.sites:
            raise ModelError(f"{playback.model.name} has no attention at the sites asked for: {sorted(sites or ())}")
        grid = attention.grid
        pixel = query[index] if isinstance(query, Mapping) else query
        token = grid.token_at(*pixel)
        row, column = divmod(token, grid.columns)
        rows = torch.stack([attention.rows(site, [token])[:, 0] for site in attention.sites])
        if head is not None:
            rows = torch.stack([choose_head(of_site, head) for of_site in rows])[:, None]
            rows = rows / rows.sum(-1, keepdim=True)
        within = Region.whole(grid) if region is None else region
        if near is not None:
            within = Region.around(pixel, near)
        on_grid = rows.unflatten(-1, (grid.rows, grid.columns))
        yield Moment(
            index,
            playback.windows[index].t_stop,
            pixel,
            attention.sites,
            mass_on(rows, region_shares(grid, within)),
            entropy_bits(rows),
            on_grid[:, :, row].clone(),  # a copy, so that a track does not hold on to every whole map
            on_grid[..., column].clone(),
        )


def norms_through_time(
    playback: Playback, indices: Sequence[int], cancelled: Callable[[], bool] | None = None
) -> Iterator[tuple[int, LevelNorms]]:
    """The norms of each ConvLSTM level after each of the windows `indices`; decodes nothing."""
    require(playback.model, "gates")
    for index in indices:
        yield index, level_norms(playback.state(index, cancelled))
