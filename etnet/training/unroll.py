"""One truncated stretch: step the backbone through all windows, decode and score some frames as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn.functional import interpolate

from etnet.nets.base import Pyramid, State
from etnet.nets.etnet import NUM_LEVELS, ETNet
from etnet.nets.intervention import Intervention
from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.positions import Placement
from etnet.training.config import ContextConfig, TrainConfig


@dataclass(frozen=True, eq=False)
class Draw:
    """What is random about one update. `blind` marks hidden tokens of each decoded frame, frames before clips."""

    scored: tuple[int, ...]
    intervention: Intervention
    placement: Placement
    blind: Bool[Tensor, "b rows columns"] | None


def draw_update(config: TrainConfig, update: int, lanes: Sequence[int]) -> Draw:
    """Pure in (seed, update, lane): processes agree on all but their own lanes' blind squares."""
    rng = np.random.default_rng([config.seed, 2, update])
    stage = config.stages[config.stage_at(update)[0]]
    grid = TokenGrid(*stage.size)
    uses_pairs = config.loss.temporal > 0 and update >= config.loss.temporal_after
    scored = _draw_scored(config.truncate, config.loss.num_scored, uses_pairs, rng)
    dropped: frozenset[int] = frozenset()
    if rng.random() < skip_drop_at(config.context, update):
        deepest = max(1, config.network.deepest_skip)
        dropped = frozenset(range(int(rng.integers(1, deepest + 1)), NUM_LEVELS + 1))
    placement = draw_placement(config.context, grid, rng)
    blind = None
    if rng.random() < config.context.blind_share:
        masks = [
            [
                _draw_blind(config.context, grid, np.random.default_rng([config.seed, 3, update, i, lane]))
                for lane in lanes
            ]
            for i in range(len(scored))
        ]
        blind = torch.from_numpy(np.array(masks)).flatten(0, 1)
    intervention = Intervention(removed_skips=dropped, without_context=config.context.without_context)
    return Draw(scored, intervention, placement, blind)


def skip_drop_at(config: ContextConfig, update: int) -> float:
    """From `skip_drop` in a straight line to `skip_drop_end`."""
    done = min(1.0, update / max(1, config.skip_drop_updates))
    return config.skip_drop + (config.skip_drop_end - config.skip_drop) * done


def draw_placement(config: ContextConfig, grid: TokenGrid, rng: np.random.Generator) -> Placement:
    """A place for a crop on a sensor of random size (log-uniform), so that all positions of full sensors are met."""
    low, high = np.log(config.sensor_rows), np.log(config.sensor_columns)
    rows = max(grid.rows, round(float(np.exp(rng.uniform(*low)))))
    columns = max(grid.columns, round(float(np.exp(rng.uniform(*high)))))
    row = int(rng.integers(rows - grid.rows + 1))
    return Placement(row, int(rng.integers(columns - grid.columns + 1)), columns)


def unroll(
    model: ETNet, voxels: Float[Tensor, "t b bins h w"], state: State | None, scored: Sequence[int]
) -> tuple[Pyramid, State]:
    """Encode every window; the pyramids of the `scored` ones as one batch (frames before clips), and the last state."""
    kept = []
    for index, voxel in enumerate(voxels):
        pyramid, state = model.encode(voxel, state)
        if index in scored:
            kept.append(pyramid)
    assert state is not None
    levels = tuple(torch.cat(level) for level in zip(*(pyramid.levels for pyramid in kept), strict=True))
    return Pyramid(levels, kept[0].height, kept[0].width), state


def restart(state: State | None, is_cold: Bool[Tensor, " b"]) -> State | None:
    """Zero memory for the clips that begin, and no gradient into the stretch before."""
    if state is None:
        return None
    keep = (~is_cold).to(state.tensors[0].dtype)[:, None, None, None]
    return State(tuple(tensor.detach() * keep for tensor in state.tensors))


def blindfold(pyramid: Pyramid, blind: Bool[Tensor, "b rows columns"]) -> Pyramid:
    """The pyramid with levels 1 … 3 zero under the marked tokens; the head still sees the window's own events."""
    keep = (~blind).unsqueeze(1).to(pyramid.levels[0], non_blocking=True)
    hidden = [
        level * interpolate(keep, scale_factor=PATCH // 2**index, mode="nearest")
        for index, level in enumerate(pyramid.levels)
        if index > 0
    ]
    return Pyramid((pyramid.levels[0], *hidden), pyramid.height, pyramid.width)


def _draw_scored(length: int, count: int, in_pairs: bool, rng: np.random.Generator) -> tuple[int, ...]:
    if count == 0 or count >= length:
        return tuple(range(length))
    if not in_pairs:
        return tuple(sorted(int(i) for i in rng.choice(length, count, replace=False)))
    starts = rng.choice(length // 2, max(1, count // 2), replace=False) * 2 + int(rng.integers(2)) * (length % 2)
    return tuple(sorted(int(i) + step for i in starts for step in (0, 1)))


def _draw_blind(config: ContextConfig, grid: TokenGrid, rng: np.random.Generator) -> np.ndarray:
    mask = np.zeros((grid.rows, grid.columns), bool)
    for _ in range(int(rng.integers(config.blind_squares[0], config.blind_squares[1] + 1))):
        rows, columns = (int(rng.integers(config.blind_tokens[0], config.blind_tokens[1] + 1)) for _ in range(2))
        row, column = int(rng.integers(grid.rows)), int(rng.integers(grid.columns))
        mask[row : row + rows, column : column + columns] = True
    return mask
