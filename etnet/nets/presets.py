"""Networks by name."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import nn

from etnet.errors import ModelError
from etnet.nets.etnet import ETNet, ETNetConfig

_HALF = ETNetConfig(
    base_channels=16, dim=128, feed_forward=512, projects_coarsest=True, token_norm=True, context_norm=True
)

PRESETS: dict[str, ETNetConfig] = {
    "etnet": ETNetConfig(),
    "etnet-half": _HALF,
    "tiny": replace(_HALF, base_channels=4, dim=32, heads=4, feed_forward=64, encoder_depth=1, decoder_depth=1),
}
"""`etnet`: the paper's best. `etnet-half`: half its width, our default on a CPU. `tiny`: for tests."""

ARCHITECTURES: dict[str, tuple[type[ETNetConfig], type[ETNet]]] = {"ETNet": (ETNetConfig, ETNet)}
"""Configuration and network by the class name that weights files carry."""


def build_model(preset_or_config: str | ETNetConfig, generator: torch.Generator | None = None) -> ETNet:
    """A network with fresh random weights: for training and tests, never shown as a reconstruction.

    The initialisation is drawn from `generator` (a fixed one when none is given), never from torch's global one.
    """
    if isinstance(preset_or_config, str):
        if preset_or_config not in PRESETS:
            raise ModelError(f"no preset is called {preset_or_config!r}; there are {', '.join(PRESETS)}")
        preset_or_config = PRESETS[preset_or_config]
    seed = int(torch.randint(2**31, (1,), generator=generator or torch.Generator().manual_seed(0)))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return ETNet(preset_or_config).eval()


def num_parameters(model: nn.Module) -> int:
    """Learned numbers in a network."""
    return sum(parameter.numel() for parameter in model.parameters())
