"""FireNet (Scheerlinck et al., WACV 2020) and FireNet+ (Stoffregen et al., ECCV 2020): 37,777 parameters, full size."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.functional import relu

from etnet.errors import ModelError
from etnet.nets.abilities import STATE_INTERVENTIONS, Abilities
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.backbone import check_voxel
from etnet.nets.base import Pyramid, State
from etnet.nets.blocks import ConvGRU, Residual
from etnet.nets.composed import Composed
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.runtime import precision_of


@dataclass(frozen=True, slots=True)
class FireNetConfig:
    """A FireNet. FireNet+ is the same network, trained without voxel normalisation."""

    bins: int = 5
    channels: int = 16
    normalise_voxels: bool = True

    def __post_init__(self) -> None:
        if self.bins < 1 or self.channels < 1:
            raise ModelError(f"FireNetConfig: got {self.bins} bins and {self.channels} channels; both are at least 1")


FIRENET_PRESETS: dict[str, FireNetConfig] = {
    "firenet": FireNetConfig(),
    "firenet+": FireNetConfig(normalise_voxels=False),
}


class FireNet(Composed):
    """Head → gated memory → residual → gated memory → residual → 1×1. State: the two memories, in this order.

    Frames are unbounded: the last layer has no activation. For interventions the two memories are levels 1 and 2.
    """

    abilities = Abilities(levels=2, gradients=True, split=True, interventions=STATE_INTERVENTIONS)

    def __init__(self, config: FireNetConfig) -> None:
        super().__init__("firenet", config.bins, config.normalise_voxels)
        self.config = config
        self.head = nn.Conv2d(config.bins, config.channels, kernel_size=3, padding=1)
        self.memories = nn.ModuleList(ConvGRU(config.channels) for _ in range(2))
        self.residuals = nn.ModuleList(Residual(config.channels) for _ in range(2))
        self.tail = nn.Conv2d(config.channels, 1, kernel_size=1)

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """The second residual block and the last layer. There is no attention to probe."""
        with precision_of(self.runtime, pyramid.levels[0].device.type):
            image = self.residuals[1](pyramid.levels[0])
        with torch.autocast(image.device.type, enabled=False):
            return self.tail(image.float()), None

    def pyramid(self, voxel: Float[Tensor, "b bins h w"], state_after: State) -> Pyramid:
        """The pyramid of the step that ended in `state_after`: its second memory is all that `decode` reads."""
        check_voxel(voxel, self.bins)
        return Pyramid((state_after.tensors[1],), voxel.shape[-2], voxel.shape[-1])

    def _advance(
        self, voxel: Tensor, state: State | None, intervention: Intervention
    ) -> tuple[tuple[Tensor, ...], State]:
        first = self._remember(0, relu(self.head(voxel)), state, intervention)
        second = self._remember(1, self.residuals[0](first), state, intervention)
        return (second,), State((first, second))

    def _remember(self, index: int, image: Tensor, state: State | None, intervention: Intervention) -> Tensor:
        before = None if state is None or index + 1 in intervention.zeroed_levels else state.tensors[index]
        after = self.memories[index](image, before)
        return before if index + 1 in intervention.frozen_levels and before is not None else after
