"""What ET-Net and E2VID share: the recurrent backbone's step and the upsampler's, as functions over their blocks."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from jaxtyping import Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.base import State

if TYPE_CHECKING:
    from torch.nn import Module

    from etnet.nets.intervention import Intervention


def advance(
    head: Tensor, blocks: Iterable[Module], state: State | None, intervention: Intervention
) -> tuple[tuple[Tensor, ...], State]:
    """The feature pyramid (head, then each level's hidden state) and the state after it (paper, eq. 2)."""
    levels, memory, features = [head], [], head
    for level, block in enumerate(blocks, start=1):
        before = None if state is None else state.tensors[2 * level - 2 : 2 * level]
        if level in intervention.zeroed_levels:
            before = None
        features, cell = block(features, before)
        if level in intervention.frozen_levels and before is not None:
            features, cell = before
        levels.append(features)
        memory += [features, cell]
    return tuple(levels), State(tuple(memory))


def upsample(image: Tensor, levels: tuple[Tensor, ...], blocks: Iterable[Module], skips: frozenset[int]) -> Tensor:
    """From the coarsest level up: add a level's features where it is in `skips`, double the size (paper, eq. 4); the
    head's are last."""
    for level, block in zip(reversed(range(1, len(levels))), blocks, strict=True):
        if level in skips:
            image = image + levels[level]
        image = block(image)
    return image + levels[0] if 0 in skips else image


def check_voxel(voxel: Float[Tensor, "b bins h w"], bins: int) -> None:
    """Refuse a grid that the network cannot take."""
    if voxel.ndim != 4 or voxel.shape[1] != bins:
        raise ModelError(f"voxel grid is {tuple(voxel.shape)}; this network takes (batch, {bins}, h, w)")
