"""Every head of every site at a glance: how sharp, how far, and what the frame loses when the head is masked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.inspection.anatomy import require
from etnet.inspection.entropy import entropy_bits, map_numbers, token_middles
from etnet.inspection.pyramid import give_up_if, hold
from etnet.nets.attention import Attention
from etnet.nets.intervention import Intervention
from etnet.playback.playback import Playback

TILE = 256
"""Queries whose rows are in memory at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class HeadTable:
    """How sharp and how far every head looks: from one token, or as the mean over all queries of the frame."""

    sites: tuple[str, ...]
    entropy: Float[Tensor, "sites heads"]
    """Bits."""
    distance: Float[Tensor, "sites heads"]
    """Mean distance from the query to what it reads, pixels."""


@dataclass(frozen=True, slots=True, eq=False)
class Atlas:
    """What each head does to one frame, measured so far: one decode for each head that is masked.

    Heads are measured in the order of `sites`, head by head; `differences[i]` belongs to `heads[i]`.
    """

    index: int
    base: Intervention
    """What holds beside the masks: the branch's own change."""
    sites: tuple[str, ...]
    num_heads: int
    frame: Float[Tensor, "h w"]
    """With every head, raw."""
    uniform: Float[Tensor, "h w"]
    """All attention made uniform − as it is: near zero where attention matters little, whatever single heads do."""
    differences: tuple[Float[Tensor, "h w"], ...] = ()
    """Masked − not masked, for each head measured."""

    @property
    def heads(self) -> tuple[tuple[str, int], ...]:
        """(site, head) of all heads, in the order of measuring."""
        return tuple((site, head) for site in self.sites for head in range(self.num_heads))

    @property
    def progress(self) -> tuple[int, int]:
        """(heads measured, heads in all)."""
        return len(self.differences), len(self.sites) * self.num_heads

    @property
    def is_whole(self) -> bool:
        """Whether every head was measured."""
        done, wanted = self.progress
        return done == wanted

    @property
    def measured(self) -> Bool[Tensor, "sites heads"]:
        """Which heads were."""
        return ~self.on_image.isnan()

    @property
    def on_image(self) -> Float[Tensor, "sites heads"]:
        """Mean |difference| over the frame; NaN where not yet measured."""
        return self._table([float(difference.abs().mean()) for difference in self.differences])

    def on_pixel(self, x: int, y: int) -> Float[Tensor, "sites heads"]:
        """The signed difference at a pixel; NaN where not yet measured. Another pixel costs no decode."""
        return self._table([float(difference[y, x]) for difference in self.differences])

    @property
    def nbytes(self) -> int:
        """Bytes of the maps: a frame for each head measured, and two more."""
        return sum(map_.nbytes for map_ in (self.frame, self.uniform, *self.differences))

    def _table(self, values: list[float]) -> Float[Tensor, "sites heads"]:
        table = torch.full((len(self.sites) * self.num_heads,), torch.nan)
        table[: len(values)] = torch.tensor(values)
        return table.reshape(len(self.sites), self.num_heads)


def masking(base: Intervention, site: str, head: int) -> Intervention:
    """`base` with one more head masked."""
    return replace(base, masked_heads=base.masked_heads | {(site, head)})


def head_atlas(
    playback: Playback, index: int, so_far: Atlas | None = None, cancelled: Callable[[], bool] | None = None
) -> Iterator[Atlas]:
    """Mask every head of window `index`, one decode each; the atlas so far after each, the first without a head.

    It can be left at any time and taken up again with `so_far`, which measures no head twice. A whole atlas is
    yielded once and ends the work.
    """
    parts = require(playback.model, "atlas")
    base = playback.intervention_at(index)
    if so_far is not None and (so_far.index, so_far.base, so_far.sites) != (index, base, parts.sites):
        raise ModelError(f"the atlas so far is of window {so_far.index} or of another change; start without it")
    give_up_if(cancelled, "this atlas")
    held = hold(playback, index, cancelled)
    atlas = so_far
    if atlas is None:
        frame = held.frame(base)
        uniform = held.frame(replace(base, uniform_attention=True))
        atlas = Atlas(index, base, parts.sites, parts.num_heads, frame, _less(uniform, frame))
    yield atlas
    for site, head in atlas.heads[len(atlas.differences) :]:
        give_up_if(cancelled, "this atlas")
        difference = _less(held.frame(masking(base, site, head)), atlas.frame)
        atlas = replace(atlas, differences=(*atlas.differences, difference))
        yield atlas


def head_maps(attention: Attention, token: int) -> Float[Tensor, "sites heads rows columns"]:
    """Where `token` looks, for every head of every probed site: the atlas's thumbnails. Sites share one grid."""
    grid = attention.grid
    rows = torch.stack([attention.rows(site, [token])[:, 0] for site in attention.sites])
    return rows.unflatten(-1, (grid.rows, grid.columns))


def head_table(attention: Attention, token: int | None = None) -> HeadTable:
    """Entropy and distance of every head of the probed sites: of one token's maps, or the mean over all queries."""
    if token is not None:
        numbers = [map_numbers(attention.rows(site, [token]), attention.grid, [token]) for site in attention.sites]
        entropy, distance = ([getattr(n, name)[:, 0] for n in numbers] for name in ("entropy", "distance"))
        return HeadTable(attention.sites, torch.stack(entropy), torch.stack(distance))
    means = [_frame_means(attention, site) for site in attention.sites]
    return HeadTable(attention.sites, *(torch.stack(column) for column in zip(*means, strict=True)))


def strongest_heads(effect: Float[Tensor, "sites heads"], sites: tuple[str, ...]) -> tuple[tuple[str, int, float], ...]:
    """(site, head, effect) by |effect|, the largest first; of equals the earlier. Heads not measured are left out."""
    flat, num_heads = effect.flatten(), effect.shape[1]
    order = torch.argsort(flat.abs().nan_to_num(-1.0), descending=True, stable=True)
    return tuple((sites[i // num_heads], i % num_heads, float(flat[i])) for i in order.tolist() if not flat[i].isnan())


def _frame_means(attention: Attention, site: str) -> tuple[Float[Tensor, " heads"], Float[Tensor, " heads"]]:
    """Entropy and distance of a site's heads, the mean over all queries, in tiles."""
    middles = token_middles(attention.grid)
    num_tokens = attention.grid.num_tokens
    entropy, distance = torch.zeros(2, attention.queries[site].shape[0])
    for start in range(0, num_tokens, TILE):
        queries = range(start, min(start + TILE, num_tokens))
        rows = attention.rows(site, queries).to(middles.device)
        entropy += entropy_bits(rows).sum(1)
        distance += (rows * torch.cdist(middles[list(queries)], middles)).sum((1, 2))
    return entropy / num_tokens, distance / num_tokens


def _less(changed: Tensor, original: Tensor) -> Tensor:
    with torch.inference_mode():
        return (changed - original).cpu()
