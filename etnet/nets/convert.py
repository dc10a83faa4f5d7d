"""Released checkpoints → our models, whatever they were trained as."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor

from etnet.nets.checkpoint_reader import read_checkpoint, state_dict_of
from etnet.nets.presets import Network, NetworkConfig, build_model, num_parameters
from etnet.nets.released import config_of, from_released
from etnet.nets.released_pienet import is_pienet, pienet_from_released
from etnet.nets.released_rivals import (
    e2vid_config_of,
    e2vid_state_from_released,
    firenet_config_of,
    firenet_state_from_released,
    is_legacy_firenet,
    released_kind,
)
from etnet.nets.weights import load_strictly


def convert_checkpoint(path: Path, heads: int = 8) -> tuple[Network, str]:
    """The model in a released checkpoint, and one line that says what it is.

    ET-Net, E2VID, E2VID+, FireNet, FireNet+, PIE-Net and PIE-Net-Lite are told apart by their parameters' names.
    `heads` is ET-Net's.
    """
    config, state, what = _understand(state_dict_of(read_checkpoint(path), path.name), heads)
    model = build_model(config)
    load_strictly(model, state, path.name)
    card: dict[str, object] = {"title": f"converted from {path.name}", "target_tone": "as trained"}
    model.card = card
    return model, f"{what}, {num_parameters(model):,} parameters"


def _understand(released: Mapping[str, Tensor], heads: int) -> tuple[NetworkConfig, dict[str, Tensor], str]:
    """Configuration, parameters under our names, and what it is in words."""
    if is_pienet(released):
        config, state = pienet_from_released(released)
        kind = "PIE-Net-Lite" if len(config.pools) == 2 else "PIE-Net"
        return config, state, f"{kind}, {len(config.pools)} levels, voxels as they are"
    match released_kind(released):
        case "firenet":
            state, is_legacy = firenet_state_from_released(released), is_legacy_firenet(released)
            kind = "FireNet, normalised voxels" if is_legacy else "FireNet+, voxels as they are"
            return firenet_config_of(state, normalise_voxels=is_legacy), state, kind
        case "e2vid":
            state = e2vid_state_from_released(released)
            config = e2vid_config_of(state)
            kind = "E2VID, normalised voxels" if config.normalise_voxels else "E2VID+, voxels as they are"
            return config, state, f"{kind}, {config.residual_blocks} residual blocks"
        case _:
            state = from_released(released)
            config = config_of(state, heads)
            return config, state, f"ET-Net, {config.scales} scales, {heads} heads"
