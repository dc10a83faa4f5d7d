"""The parameter names of the released ET-Net code, and ours. Its index 0 is the coarsest scale, the paper's scale 3."""

from __future__ import annotations

import re
from collections.abc import Mapping

from torch import Tensor

from etnet.errors import WeightsError
from etnet.nets.etnet import NUM_LEVELS, ETNetConfig

_RENAMES: tuple[tuple[str, str], ...] = (
    (r"head\.conv2d\.", "head.conv."),
    (r"DownsampleConv\.(\d)\.conv\.conv2d\.", r"backbone.\1.down.conv."),
    (r"DownsampleConv\.(\d)\.recurrent_block\.Gates\.", r"backbone.\1.memory.gates."),
    (r"split(\d)\.", r"tpa.sequentialize.<\1>.project."),
    (r"token_norm\.(\d)\.", r"tpa.sequentialize.<\1>.norm."),
    (r"final_norm\.", "tpa.norm."),
    (r"trans_encoder(\d)\.encoder\.layers\.(\d+)\.", r"tpa.encoders.<\1>.\2."),
    (r"trans_decoder(\d)\.decoder\.layers\.(\d+)\.", r"tpa.decoders.<\1>.\2."),
    (r"UpsampleConv\.(\d)\.conv2d\.", r"upsampler.\1.conv.conv."),
    (r"pred\.conv2d\.", "tail."),
)
_ENCODER_PARTS = {
    "self_attn": "attention",
    "norm1": "attention_norm",
    "norm2": "feed_forward_norm",
    "linear1": "feed_forward.expand",
    "linear2": "feed_forward.contract",
}
_DECODER_PARTS = {
    "self_attn": "self_attention",
    "cross_attn": "cross_attention",
    "norm1": "self_norm",
    "norm21": "query_norm",
    "norm22": "memory_norm",
    "norm3": "feed_forward_norm",
    "linear1": "feed_forward.expand",
    "linear2": "feed_forward.contract",
}


def rename_released(name: str) -> str:
    """The name that one released parameter has here; the name itself where the rules do not know it."""
    name = name.removeprefix("module.")
    for pattern, ours in _RENAMES:
        found = re.match(pattern, name)
        if found is None:
            continue
        prefix = re.sub(r"<(\d)>", lambda index: str(NUM_LEVELS - int(index[1])), found.expand(ours))
        rest = name[found.end() :]
        parts = {"tpa.enc": _ENCODER_PARTS, "tpa.dec": _DECODER_PARTS}.get(prefix[:7])
        if parts is not None:
            part, _, leaf = rest.partition(".")
            rest = f"{parts.get(part, part)}.{leaf}"
        return prefix + rest
    return name


def from_released(released: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """A released state dict under our names."""
    return {rename_released(name): tensor for name, tensor in released.items()}


def config_of(state: Mapping[str, Tensor], heads: int = 8) -> ETNetConfig:
    """Read off a state dict (our names) what its shapes tell. The number of heads no shape tells: it is given."""
    try:
        base_channels, bins = state["head.conv.weight"].shape[:2]
        dim = state["tpa.encoders.3.0.attention.out_proj.weight"].shape[0]
        feed_forward = state["tpa.encoders.3.0.feed_forward.expand.weight"].shape[0]
    except KeyError as error:
        raise WeightsError(f"no {error.args[0]} among the parameters; these are not an ET-Net's weights") from None
    return ETNetConfig(
        bins=bins,
        base_channels=base_channels,
        dim=dim,
        heads=heads,
        feed_forward=feed_forward,
        scales=_count(state, r"tpa\.encoders\.(\d)\."),
        encoder_depth=_count(state, r"tpa\.encoders\.3\.(\d+)\."),
        decoder_depth=_count(state, r"tpa\.decoders\.3\.(\d+)\."),
        projects_coarsest="tpa.sequentialize.3.project.weight" in state,
        token_norm="tpa.sequentialize.3.norm.weight" in state,
        context_norm="tpa.norm.weight" in state,
    )


def _count(state: Mapping[str, Tensor], pattern: str) -> int:
    return len({found[1] for name in state if (found := re.match(pattern, name))})
