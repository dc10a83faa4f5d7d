"""Parameter names of the package `event-pienet` → ours. Pure functions of a state dict."""

from __future__ import annotations

import re
from collections.abc import Mapping

from torch import Tensor

from etnet.errors import WeightsError
from etnet.nets.pienet import PIENetConfig

_CONVOLUTION_AND_NORM = (("convna.0.", "conv."), ("convna.1.", "norm."))
_RULES = (
    (r"model\.stem\.event_branch\.mbconv\.", "events_stem."),
    (r"model\.stem\.frame_branch\.mbconv\.", "frame_stem."),
    (r"model\.downs\.(\d)\.mbd\.Gates\.mbconv\.0\.", r"levels.\1.memory.expand."),
    (r"model\.downs\.(\d)\.mbd\.Gates\.mbconv\.1\.fc1\.", r"levels.\1.memory.squeeze."),
    (r"model\.downs\.(\d)\.mbd\.Gates\.mbconv\.1\.fc2\.", r"levels.\1.memory.excite."),
    (r"model\.downs\.(\d)\.mbd\.Gates\.mbconv\.2\.", r"levels.\1.memory.project."),
    (r"model\.downs\.(\d)\.mbd\.norm_h\.", r"levels.\1.memory.hidden_norm."),
    (r"model\.downs\.(\d)\.mbd\.norm_c\.", r"levels.\1.memory.cell_norm."),
    (r"model\.downs\.(\d)\.out\.mbconv_0\.mbconv\.", r"levels.\1.refine."),
    (r"model\.downs\.(\d)\.film\.film\.", r"levels.\1.modulate."),
    (r"model\.ups\.(\d)\.fuse\.0\.mbconv\.", r"rises.\1.fuse."),
    (r"model\.ups\.(\d)\.ugate\.gate_conv\.", r"rises.\1.trust."),
    (r"model\.outc\.", "latent."),
    (r"cal_k\.mbconv\.", "offset."),
)
_POOLS = {2: (2, 2), 3: (2, 2, 5)}
"""Levels → pools of the two networks that were published; no parameter's shape tells them."""


def is_pienet(released: Mapping[str, Tensor]) -> bool:
    """Whether a state dict is one of the package's."""
    return "model.stem.event_branch.mbconv.convna.0.weight" in released


def pienet_from_released(released: Mapping[str, Tensor]) -> tuple[PIENetConfig, dict[str, Tensor]]:
    """Configuration and parameters under our names, every parameter of the file in use.

    PIE-Net's own file (package version 1.1.3) holds refining blocks that the package does not run; a state dict
    without them gives the package's frames.
    """
    state = {_renamed(name): tensor for name, tensor in released.items()}
    num_levels = len({name.split(".")[1] for name in state if name.startswith("levels.")})
    if num_levels not in _POOLS:
        raise WeightsError(f"a PIE-Net of {num_levels} levels was never published; known are 3 (PIE-Net) and 2 (Lite)")
    widths = [state["events_stem.conv.weight"].shape[0]]
    widths += [state[f"levels.{i}.memory.hidden_norm.weight"].shape[0] for i in range(num_levels)]
    return PIENetConfig(
        bins=state["events_stem.conv.weight"].shape[1],
        channels=tuple(widths),
        pools=_POOLS[num_levels],
        refines="levels.0.refine.conv.weight" in state,
    ), state


def _renamed(name: str) -> str:
    for pattern, ours in _RULES:
        found = re.match(pattern, name)
        if found is not None:
            leaf = name[found.end() :]
            for theirs, part in _CONVOLUTION_AND_NORM:
                leaf = leaf.replace(theirs, part)
            return found.expand(ours) + leaf
    raise WeightsError(f"parameter {name} is in no published PIE-Net; name the architecture that it belongs to")
