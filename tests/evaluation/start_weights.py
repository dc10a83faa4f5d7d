"""The first trained weights of this project, whose scores are known: read from the original arrays."""

import numpy as np
import torch

from etnet.nets.etnet import ETNet, ETNetConfig
from etnet.nets.presets import build_model
from etnet.nets.released import from_released
from etnet.nets.weights import load_strictly
from tests.real_data import real_file

_FIRST = ETNetConfig(
    base_channels=16, dim=128, feed_forward=512, projects_coarsest=True, token_norm=True, context_norm=True
)


def start_weights() -> ETNet:
    """The first half-width network with its weights; skips the test where the file is absent."""
    with np.load(real_file("../weights/etnet_half_start.npz")) as file:
        arrays = {name: torch.from_numpy(file[name]) for name in file.files if not name.startswith("_")}
    model = build_model(_FIRST)
    load_strictly(model, from_released(arrays), "etnet_half_start.npz")
    return model
