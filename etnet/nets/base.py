"""What every reconstruction network is: one pure step `(voxel, state) → (frame, state)`, split where memory ends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.storage import kept_alive


@dataclass(frozen=True, slots=True)
class State:
    """All that a later frame depends on: a flat tuple of tensors, kept in the dtype they were computed in.

    A cold start is `None`, never an empty state.
    """

    tensors: tuple[Tensor, ...]

    def __iter__(self) -> Iterator[Tensor]:
        return iter(self.tensors)

    def __len__(self) -> int:
        return len(self.tensors)

    def to(self, device: torch.device | str) -> State:
        """The same state on another device."""
        return State(tuple(tensor.to(device) for tensor in self.tensors))

    def detach(self) -> State:
        """The same values, cut off from the gradient (truncated back-propagation)."""
        return State(tuple(tensor.detach() for tensor in self.tensors))

    def clone(self) -> State:
        """A copy that shares no memory."""
        return State(tuple(tensor.clone() for tensor in self.tensors))

    @property
    def nbytes(self) -> int:
        """Bytes held by the tensors."""
        return kept_alive(self.tensors)


@dataclass(frozen=True, slots=True)
class Pyramid:
    """What the backbone hands to the decoder for one frame: padded feature maps and the sensor size to crop back to.

    For ET-Net `levels[0]` is the head and `levels[l]` the hidden state of level l at 1/2ˡ.
    """

    levels: tuple[Float[Tensor, "b _ _ _"], ...]
    height: int
    width: int


@dataclass(frozen=True, slots=True)
class Step:
    """One step's result: the raw, unclipped frame at sensor size, the state after it, what a probe asked for.

    `variance` is the network's own estimate for each pixel, `None` where `abilities.variance` is false.
    """

    frame: Float[Tensor, "b 1 h w"]
    state: State
    attention: Attention | None = None
    variance: Float[Tensor, "b 1 h w"] | None = None


@runtime_checkable
class Reconstructor(Protocol):
    """A network that turns voxel grids into frames. `model(voxel, state)` = decode ∘ encode.

    `encode` is the recurrent part, all that a later frame depends on; `decode` has no memory; `pyramid` rebuilds
    what `encode` would hand to `decode`, from the voxel grid and the state *after* it, so that a kept state gives
    its own frame with no replay. What else a network can do it declares as `abilities` (`etnet.nets.abilities`).
    """

    name: str
    bins: int
    normalise_voxels: bool

    def encode(
        self, voxel: Float[Tensor, "b bins h w"], state: State | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Pyramid, State]:
        """Advance the memory by one window."""
        ...

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """The frame of one moment, and the attention that was asked for."""
        ...

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The pyramid of the step that ended in `state_after`."""
        ...

    def __call__(
        self,
        voxel: Float[Tensor, "b bins h w"],
        state: State | None = None,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
    ) -> Step:
        """One whole step."""
        ...


def variance_of(model: Reconstructor, state: State) -> Float[Tensor, "b 1 h w"] | None:
    """The variance map of the frame that belongs to `state`; `None` for a network that estimates none."""
    estimate = getattr(model, "variance", None)
    return None if estimate is None else estimate(state)
