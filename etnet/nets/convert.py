"""Released checkpoints → our models, whatever they were trained as."""

from __future__ import annotations

from pathlib import Path

import torch

from etnet.nets.checkpoint_reader import read_checkpoint, state_dict_of
from etnet.nets.etnet import ETNet
from etnet.nets.presets import num_parameters
from etnet.nets.released import config_of, from_released
from etnet.nets.weights import load_strictly


def convert_checkpoint(path: Path, heads: int = 8) -> tuple[ETNet, str]:
    """The model in a released checkpoint, and one line that says what it is."""
    state = from_released(state_dict_of(read_checkpoint(path), path.name))
    config = config_of(state, heads)
    with torch.random.fork_rng(devices=[]):
        model = ETNet(config).eval()
    load_strictly(model, state, path.name)
    model.card = {"title": f"converted from {path.name}", "target_tone": "as trained"}
    return model, f"ET-Net, {num_parameters(model):,} parameters, {config.scales} scales, {heads} heads"
