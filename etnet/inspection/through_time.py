"""One query followed through time: where its attention lies, how sharp it is, and how the state's norms run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from etnet.errors import Cancelled, ModelError
from etnet.inspection.entropy import entropy_bits
from etnet.inspection.gates import LevelNorms, level_norms, recurrent_levels
from etnet.inspection.mass import Region, mass_on, region_shares
from etnet.nets.attention import AttentionProbe
from etnet.playback.playback import Playback


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The pinned query in one window. `along_row` and `along_column` are attention on the query's own token row and
    column: one line of a kymograph."""

    index: int
    t: int
    """The frame's stamp, µs."""
    sites: tuple[str, ...]
    mass: Float[Tensor, "sites heads"]
    """Attention on the region."""
    entropy: Float[Tensor, "sites heads"]
    """Bits."""
    along_row: Float[Tensor, "sites heads columns"]
    along_column: Float[Tensor, "sites heads rows"]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Moments put together, in the order in which they came."""

    index: Int64[Tensor, " windows"]
    t: Int64[Tensor, " windows"]
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
        return Track(index, t, held[0].sites, *stacked)


def attention_through_time(
    playback: Playback,
    query: tuple[int, int],
    indices: Sequence[int],
    sites: frozenset[str] | None = None,
    region: Region | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[Moment]:
    """The query pixel (x, y) in each of the windows `indices`, one decode each; ascending indices replay least.

    `sites` are all by default, `region` is the whole sensor (so that `mass` is what does not lie on padding).
    `cancelled` is asked before every window and between replayed steps, and ends the work with `Cancelled`.
    """
    for index in indices:
        if cancelled is not None and cancelled():
            raise Cancelled("nobody wants this track any more")
        attention = playback.at(index, AttentionProbe(sites), cancelled=cancelled).attention
        if attention is None or not attention.sites:
            raise ModelError(f"{playback.model.name} has no attention to follow, or none at the sites asked for")
        grid = attention.grid
        token = grid.token_at(*query)
        row, column = divmod(token, grid.columns)
        rows = torch.stack([attention.rows(site, [token])[:, 0] for site in attention.sites])
        on_grid = rows.unflatten(-1, (grid.rows, grid.columns))
        yield Moment(
            index,
            playback.windows[index].t_stop,
            attention.sites,
            mass_on(rows, region_shares(grid, region or Region.whole(grid))),
            entropy_bits(rows),
            on_grid[:, :, row].clone(),  # a copy, so that a track does not hold on to every whole map
            on_grid[..., column].clone(),
        )


def norms_through_time(
    playback: Playback, indices: Sequence[int], cancelled: Callable[[], bool] | None = None
) -> Iterator[tuple[int, LevelNorms]]:
    """The norms of each ConvLSTM level after each of the windows `indices`; decodes nothing."""
    if not recurrent_levels(playback.model):
        raise ModelError(f"{playback.model.name} has no ConvLSTM levels")
    for index in indices:
        yield index, level_norms(playback.state(index, cancelled))
