"""E2VID (Rebecq et al., TPAMI 2019), E2VID+ (Stoffregen et al., ECCV 2020) and their deeper kin, by fields.

The backbone and the upsampler are ET-Net's; residual blocks stand where ET-Net has its token pyramid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from jaxtyping import Float
from torch import Tensor, nn

from etnet.errors import ModelError
from etnet.nets.abilities import STATE_INTERVENTIONS, Abilities
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.base import Pyramid
from etnet.nets.blocks import Residual
from etnet.nets.composed import NUM_LEVELS, RecurrentPyramid
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.runtime import precision_of

PostProcessing = Literal["none", "robust"]

MAX_BLOCKS = 64
"""Residual blocks: a bound for files that claim more than anybody trained."""


@dataclass(frozen=True, slots=True)
class E2VIDConfig:
    """An E2VID. The defaults are the first one; `outputs=3` adds the flow that E2VID+ learned beside the frame."""

    bins: int = 5
    base_channels: int = 32
    residual_blocks: int = 2
    skips: bool = True
    outputs: int = 1
    """1: the frame alone. 3: frame, flow x, flow y; the frame is channel 0."""
    final: Literal["sigmoid", "none"] = "sigmoid"
    """E2VID+ ends without an activation, so that its frames are unbounded."""
    normalise_voxels: bool = True
    post_processing: PostProcessing = "robust"
    """What EVREAL does to its frames before it scores them: stretch the 1st to the 99th percentile to 0 … 1."""

    def __post_init__(self) -> None:
        if self.bins < 1 or self.base_channels < 1 or not 0 <= self.residual_blocks <= MAX_BLOCKS:
            raise ModelError(
                f"E2VIDConfig: got {self.bins} bins, {self.base_channels} channels, {self.residual_blocks} residual "
                f"blocks; it takes at least 1, at least 1 and 0 … {MAX_BLOCKS}"
            )
        if self.outputs not in (1, 3):
            raise ModelError(f"E2VIDConfig.outputs is {self.outputs}; it takes 1 (frame) or 3 (frame and flow)")

    def channels(self, level: int) -> int:
        """C_l = C₀·2ˡ."""
        return self.base_channels * 2**level

    @property
    def skip_levels(self) -> frozenset[int]:
        """The levels whose features the decoder adds; 0 is the head."""
        return frozenset(range(NUM_LEVELS + 1)) if self.skips else frozenset()


E2VID_PLUS = E2VIDConfig(outputs=3, final="none", normalise_voxels=False, post_processing="none")

E2VID_PRESETS: dict[str, E2VIDConfig] = {
    "e2vid": E2VIDConfig(),
    "e2vid+": E2VID_PLUS,
    **{
        f"e2vid-res{blocks}": E2VIDConfig(residual_blocks=blocks, normalise_voxels=False, post_processing="none")
        for blocks in (6, 12, 16)
    },
}
"""`e2vid-res6`, `-res12`, `-res16`: the partners of ET-Net's ablations (its Table 2), of about the same size."""


class E2VID(RecurrentPyramid):
    """Recurrent U-Net. State: hidden and cell of levels 1, 2, 3, in this order."""

    abilities = Abilities(
        levels=NUM_LEVELS,
        gates=True,
        gradients=True,
        split=True,
        interventions=STATE_INTERVENTIONS | {"removed_skips"},
    )

    def __init__(self, config: E2VIDConfig) -> None:
        super().__init__("e2vid", config)
        self.config = config
        self.post_processing = config.post_processing
        deepest = config.channels(NUM_LEVELS)
        self.residuals = nn.Sequential(*(Residual(deepest) for _ in range(config.residual_blocks)))
        self._build_upsampler(config, config.outputs)

    def decode(
        self, pyramid: Pyramid, probe: AttentionProbe | None = None, intervention: Intervention = ORIGINAL
    ) -> tuple[Float[Tensor, "b 1 h w"], Attention | None]:
        """Residual blocks and decoders. There is no attention to probe."""
        with precision_of(self.runtime, pyramid.levels[0].device.type):
            deepest = self.residuals(pyramid.levels[NUM_LEVELS])
            return self._image(deepest, pyramid, intervention, is_bounded=self.config.final == "sigmoid"), None
