"""A baseline that nobody trained: add up polarities, forget slowly (Scheerlinck et al., ACCV 2018, in windows)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from etnet.errors import ModelError
from etnet.nets.abilities import Abilities
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.base import Pyramid, State
from etnet.nets.composed import Composed
from etnet.nets.intervention import ORIGINAL, Intervention


@dataclass(frozen=True, slots=True)
class IntegratorConfig:
    """`keep`: what is left of the memory after a window. `gain`: log brightness that one event adds."""

    bins: int = 5
    keep: float = 0.95
    gain: float = 0.1
    normalise_voxels: bool = False

    def __post_init__(self) -> None:
        if self.bins < 1 or not 0 <= self.keep <= 1 or self.gain <= 0:
            raise ModelError(
                f"IntegratorConfig: got {self.bins} bins, keep {self.keep}, gain {self.gain}; "
                "wanted at least 1, 0 … 1 and above 0"
            )


class LeakyIntegrator(Composed):
    """Memory: one log brightness a pixel. Frame: its logistic, so that nothing seen is the middle grey .5.

    What a network is worth can be told beside it only: it has no idea of images, and its grey is nobody's light.
    """

    abilities = Abilities(gradients=True)

    def __init__(self, config: IntegratorConfig) -> None:
        super().__init__("leaky-integrator", config.bins, config.normalise_voxels)
        self.config = config
        self.keep = nn.Parameter(torch.tensor(config.keep), requires_grad=False)
        self.gain = nn.Parameter(torch.tensor(config.gain), requires_grad=False)

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """The logistic of the memory. There is no attention to probe."""
        self._refuse(intervention)
        return torch.sigmoid(pyramid.levels[0]), None

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The memory is all that `decode` reads."""
        return Pyramid((state_after.tensors[0],), voxel.shape[-2], voxel.shape[-1])

    def _advance(
        self, voxel: Tensor, state: State | None, intervention: Intervention
    ) -> tuple[tuple[Tensor, ...], State]:
        """Forget a little, add this window's polarities."""
        self._refuse(intervention)
        added = self.gain * voxel.sum(dim=1, keepdim=True)
        brightness = added if state is None else self.keep * state.tensors[0] + added
        return (brightness,), State((brightness,))

    def _refuse(self, intervention: Intervention) -> None:
        if intervention != ORIGINAL:
            raise ModelError(f"{self.name}: has no scales and no attention, so nothing inside it can be changed")
