"""The recurrent state looked into: the gates of one step, norms and energies, and how far back each pixel remembers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.base import Reconstructor, State
from etnet.nets.blocks import RecurrentLevel
from etnet.nets.runtime import Runtime, precision_of
from etnet.playback.playback import Playback

UNKNOWN = -1
"""In `MemoryDepth.needed`: more windows than the deepest that was tried."""


@dataclass(frozen=True, slots=True, eq=False)
class Gates:
    """One ConvLSTM level in one step: cell = forget · cell_before + enter · candidate, hidden = out · tanh(cell)."""

    level: int
    enter: Float[Tensor, "channels h w"]
    forget: Float[Tensor, "channels h w"]
    out: Float[Tensor, "channels h w"]
    candidate: Float[Tensor, "channels h w"]
    """tanh'd, −1 … 1; the three before are 0 … 1."""
    cell_before: Float[Tensor, "channels h w"]
    hidden: Float[Tensor, "channels h w"]
    cell: Float[Tensor, "channels h w"]

    @property
    def kept(self) -> Float[Tensor, "channels h w"]:
        """What of the cell came from before. The forget gate alone does not say what is remembered."""
        return self.forget * self.cell_before

    @property
    def entered(self) -> Float[Tensor, "channels h w"]:
        """What of the cell came in with this window."""
        return self.enter * self.candidate


def recurrent_levels(model: Reconstructor) -> tuple[RecurrentLevel, ...]:
    """The ConvLSTM levels of a network, finest first; empty for a network without."""
    return tuple(block for block in getattr(model, "backbone", ()) if isinstance(block, RecurrentLevel))


def gates_of_step(
    model: Reconstructor, voxel: Float[Tensor, "1 bins h w"], before: State | None, after: State, level: int
) -> Gates:
    """Recompute the gates of `level` (from 1) beside the fast path, from a step's input and the states around it."""
    levels = recurrent_levels(model)
    if not 1 <= level <= len(levels):
        has = f"ConvLSTM levels 1 … {len(levels)}" if levels else "no ConvLSTM levels"
        raise ModelError(f"level {level} asked for; {model.name} has {has}")
    block = levels[level - 1]
    hidden, cell = after.tensors[2 * level - 2 : 2 * level]
    with torch.inference_mode(), precision_of(getattr(model, "runtime", Runtime()), voxel.device.type):
        image = block.down(model.pyramid(voxel, after).levels[level - 1])
        nothing = torch.zeros_like(hidden)
        hidden_before, cell_before = (nothing, nothing) if before is None else before.tensors[2 * level - 2 : 2 * level]
        gates = block.memory.gates(torch.cat((image, hidden_before.to(image.dtype)), dim=1)).float()[0]
    enter, forget, out, candidate = gates.chunk(4)
    sigmoid = torch.sigmoid
    return Gates(
        level, sigmoid(enter), sigmoid(forget), sigmoid(out), candidate.tanh(), cell_before[0], hidden[0], cell[0]
    )


def gates_at(playback: Playback, index: int, level: int, cancelled: Callable[[], bool] | None = None) -> Gates:
    """The gates of one level in the step of window `index`."""
    intervention = playback.intervention_at(index)
    if level in intervention.frozen_levels:
        raise ModelError(f"level {level} is frozen at window {index}: no gate acts; look at the branch's parent")
    has_memory = index > playback.first and level not in intervention.zeroed_levels
    before = playback.state(index - 1, cancelled) if has_memory else None
    after = playback.state(index, cancelled)
    voxel = playback.voxel(index)[None].to(after.tensors[0].device)
    return gates_of_step(playback.model, voxel, before, after, level)


@dataclass(frozen=True, slots=True, eq=False)
class LevelNorms:
    """Root mean square over channels and places of each level's state."""

    hidden: Float[Tensor, " levels"]
    cell: Float[Tensor, " levels"]


def level_norms(state: State) -> LevelNorms:
    """The norms of a state of hidden and cell by turns (ET-Net, E2VID)."""
    norms = [tensor.square().mean().sqrt() for tensor in state]
    return LevelNorms(torch.stack(norms[::2]), torch.stack(norms[1::2]))


def channel_energy(feature: Float[Tensor, "channels h w"]) -> Float[Tensor, " channels"]:
    """Mean square of each channel; sort by it to see the channels that say something first."""
    return feature.square().mean((1, 2))


@dataclass(frozen=True, slots=True, eq=False)
class MemoryDepth:
    """What the network makes of a window when it knows only the `depths` windows before it (a cold start)."""

    depths: tuple[int, ...]
    """Windows before this one; 0 is this window alone."""
    frames: Float[Tensor, "depths h w"]
    exact: Float[Tensor, "h w"]

    @property
    def differences(self) -> Float[Tensor, "depths h w"]:
        """Short memory − whole memory."""
        return self.frames - self.exact

    def needed(self, tolerance: float = 0.02) -> Int64[Tensor, "h w"]:
        """The fewest windows from which on a pixel stays within `tolerance` of the exact frame; `UNKNOWN` where more.

        Measured, unlike what forget gates suggest. `tolerance` is in units of the raw frame (0 … 1).
        """
        is_close = self.differences.abs() <= tolerance
        # Close at this depth and at every deeper one: a pixel that is right by chance for a while does not count.
        stays = is_close.flip(0).int().cumprod(0).flip(0).bool()
        depth = torch.tensor(self.depths)[stays.int().argmax(0)]
        return torch.where(stays[-1], depth, UNKNOWN)


def memory_depth(
    playback: Playback,
    index: int,
    depths: Sequence[int] = (0, 1, 2, 4, 8, 16),
    cancelled: Callable[[], bool] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> MemoryDepth:
    """Reconstruct window `index` from a cold start each of `depths` windows earlier: Σ (depth + 1) encodes.

    `progress` is told (depths done, depths in all).
    """
    depths = tuple(sorted(set(depths)))
    if not depths or depths[0] < 0:
        raise ValueError(f"depths are {depths}; wanted at least one, none below 0")
    exact = playback.at(index, cancelled=cancelled).frame[0, 0]
    frames = []
    for done, depth in enumerate(depths, start=1):
        frames.append(playback.approximate(index, depth, cancelled).frame[0, 0])
        if progress is not None:
            progress(done, len(depths))
    return MemoryDepth(depths, torch.stack(frames), exact)
