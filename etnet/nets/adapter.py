"""Somebody's own network as a `Reconstructor`, from one function: it can then be scored, played and compared."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from jaxtyping import Float
from torch import Tensor

from etnet.errors import ModelError
from etnet.nets.abilities import Abilities
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.base import Pyramid, State, Step
from etnet.nets.intervention import ORIGINAL, Intervention

Memory = tuple[Tensor, ...]
StepFunction = Callable[[Tensor, Memory | None], tuple[Tensor, Memory]]
"""(voxel grid `b bins h w`, memory or None for a cold start) → (frame `b 1 h w`, memory). It must change neither."""


@dataclass(eq=False)
class Adapter:
    """A network that gives whole steps alone. Each frame is kept with its state, so that it need not be made twice;
    seeking replays whole steps. There is no attention to probe, and interventions are refused.
    """

    step: StepFunction
    name: str
    bins: int = 5
    normalise_voxels: bool = False
    post_processing: Literal["none", "robust"] = "none"
    abilities: Abilities = field(default_factory=Abilities)
    """Say `Abilities(gradients=True)` for a step made of differentiable torch operations."""

    def encode(
        self, voxel: Float[Tensor, "b bins h w"], state: State | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Pyramid, State]:
        """One step of the network; its frame travels as the last tensor of the state."""
        self._refuse(intervention)
        frame, memory = self.step(voxel, None if state is None else state.tensors[:-1])
        wanted = (len(voxel), 1, *voxel.shape[-2:])
        if tuple(frame.shape) != wanted:
            raise ModelError(f"{self.name}: its frame is {tuple(frame.shape)}, wanted {wanted} (batch, 1, h, w)")
        state = State((*memory, frame))
        return self.pyramid(voxel, state), state

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """The frame that `encode` made."""
        self._refuse(intervention)
        return pyramid.levels[0], None

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The frame that lies in the state."""
        return Pyramid((state_after.tensors[-1],), voxel.shape[-2], voxel.shape[-1])

    def __call__(
        self,
        voxel: Float[Tensor, "b bins h w"],
        state: State | None = None,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
    ) -> Step:
        pyramid, state = self.encode(voxel, state, intervention)
        return Step(pyramid.levels[0], state)

    def _refuse(self, intervention: Intervention) -> None:
        if intervention != ORIGINAL:
            raise ModelError(f"{self.name}: gives whole steps alone, so nothing inside it can be changed")
