"""Networks by name."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, overload

import torch
from torch import nn

from etnet.errors import ModelError
from etnet.nets.e2vid import E2VID, E2VID_PRESETS, E2VIDConfig
from etnet.nets.etnet import ETNet, ETNetConfig
from etnet.nets.firenet import FIRENET_PRESETS, FireNet, FireNetConfig
from etnet.nets.integrator import IntegratorConfig, LeakyIntegrator
from etnet.nets.pienet import PIENET_PRESETS, PIENet, PIENetConfig

Network = ETNet | E2VID | FireNet | PIENet | LeakyIntegrator
"""A network that this package can build, save and load."""
NetworkConfig = ETNetConfig | E2VIDConfig | FireNetConfig | PIENetConfig | IntegratorConfig

_HALF = ETNetConfig(
    base_channels=16, dim=128, feed_forward=512, projects_coarsest=True, token_norm=True, context_norm=True
)

PRESETS: dict[str, NetworkConfig] = {
    "etnet": ETNetConfig(),
    "etnet-half": replace(_HALF, heads=4, positions="grid", scales_logits=True, deepest_skip=1, dropout=0.0),
    "tiny": replace(_HALF, base_channels=4, dim=32, heads=4, feed_forward=64, encoder_depth=1, decoder_depth=1),
    **E2VID_PRESETS,
    **FIRENET_PRESETS,
    **PIENET_PRESETS,
}
"""`etnet`: the paper's best. `etnet-half`: half its width, our default on a CPU. `tiny`: for tests. Then the rivals."""

ARCHITECTURES: dict[str, tuple[type[Any], type[Network]]] = {
    "ETNet": (ETNetConfig, ETNet),
    "E2VID": (E2VIDConfig, E2VID),
    "FireNet": (FireNetConfig, FireNet),
    "PIENet": (PIENetConfig, PIENet),
    "LeakyIntegrator": (IntegratorConfig, LeakyIntegrator),
}
"""Configuration and network by the class name that weights files carry."""

UNTRAINED: dict[str, IntegratorConfig] = {"leaky-integrator": IntegratorConfig()}
"""Baselines that need no weights: they can be loaded by name like any bundled network."""


@overload
def build_model(
    preset_or_config: ETNetConfig | Literal["etnet", "etnet-half", "tiny"], generator: torch.Generator | None = None
) -> ETNet: ...
@overload
def build_model(preset_or_config: str | NetworkConfig, generator: torch.Generator | None = None) -> Network: ...
def build_model(preset_or_config: str | NetworkConfig, generator: torch.Generator | None = None) -> Network:
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
        _, network = next(pair for pair in ARCHITECTURES.values() if isinstance(preset_or_config, pair[0]))
        return network(preset_or_config).eval()  # pyright: ignore[reportArgumentType]  the pair belongs together


def num_parameters(model: nn.Module) -> int:
    """Learned numbers in a network."""
    return sum(parameter.numel() for parameter in model.parameters())
