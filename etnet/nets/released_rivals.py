"""Released parameter names and shapes of E2VID, E2VID+, FireNet and FireNet+ → ours. Pure functions of a state dict."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Literal

import torch
from torch import Tensor

from etnet.errors import WeightsError
from etnet.nets.e2vid import E2VIDConfig
from etnet.nets.firenet import FireNetConfig

_Rules = tuple[tuple[str, str], ...]

_E2VID: _Rules = (
    (r"head\.conv2d\.", "head.conv."),
    (r"encoders\.(\d)\.conv\.conv2d\.", r"backbone.\1.down.conv."),
    (r"encoders\.(\d)\.recurrent_block\.Gates\.", r"backbone.\1.memory.gates."),
    (r"resblocks\.(\d+)\.conv1\.", r"residuals.\1.first."),
    (r"resblocks\.(\d+)\.conv2\.", r"residuals.\1.second."),
    (r"decoders\.(\d)\.conv2d\.", r"upsampler.\1.conv.conv."),
    (r"pred\.conv2d\.", "tail."),
)
_FIRENET_LEGACY: _Rules = (
    (r"head\.conv\.conv2d\.", "head."),
    (r"head\.recurrent_block\.(reset|update|out)_gate\.", r"memories.0.\1."),
    (r"resblocks\.0\.conv\.conv1\.", "residuals.0.first."),
    (r"resblocks\.0\.conv\.conv2\.", "residuals.0.second."),
    (r"resblocks\.0\.recurrent_block\.(reset|update|out)_gate\.", r"memories.1.\1."),
    (r"resblocks\.1\.conv1\.", "residuals.1.first."),
    (r"resblocks\.1\.conv2\.", "residuals.1.second."),
    (r"pred\.conv2d\.", "tail."),
)
_FIRENET_PLUS: _Rules = (
    (r"head\.conv2d\.", "head."),
    *((rf"G{i + 1}\.(reset|update|out)_gate\.", rf"memories.{i}.\1.") for i in range(2)),
    *((rf"R{i + 1}\.conv1\.", rf"residuals.{i}.first.") for i in range(2)),
    *((rf"R{i + 1}\.conv2\.", rf"residuals.{i}.second.") for i in range(2)),
    (r"pred\.conv2d\.", "tail."),
)
_WRAPPERS = re.compile(r"^(module\.|net\.|unetrecurrent\.|unetflow\.|unetfire\.)+")
"""Names of the modules that the released classes wrap their network in."""

_NORM_SITES = ((".norm_layer.", ".conv2d."), (".bn1.", ".conv1."), (".bn2.", ".conv2."))
"""Where a batch norm stands behind a convolution, by name."""


def released_kind(released: Mapping[str, Tensor]) -> Literal["firenet", "e2vid", "other"]:
    """Which of these networks a released state dict belongs to, by its parameters' names."""
    names = set(_unwrapped(released))
    if {"head.conv2d.weight", "encoders.0.conv.conv2d.weight", "pred.conv2d.weight"} <= names:
        return "e2vid"
    if any(name.endswith(".update_gate.weight") for name in names) and "pred.conv2d.weight" in names:
        return "firenet"
    return "other"


def e2vid_state_from_released(released: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The parameters of an `E2VID` (ours) from a released E2VID's or E2VID+'s."""
    return _renamed(fold_batch_norms(_unwrapped(released)), _E2VID, "E2VID")


def firenet_state_from_released(released: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The parameters of a `FireNet` (ours) from a released legacy FireNet's or FireNet+'s."""
    names = _unwrapped(released)
    is_legacy = any(name.startswith("resblocks.") for name in names)
    return _renamed(names, _FIRENET_LEGACY if is_legacy else _FIRENET_PLUS, "FireNet")


def e2vid_config_of(state: Mapping[str, Tensor]) -> E2VIDConfig:
    """The configuration that a state dict (our names) tells: three outputs mark an E2VID+, one an E2VID.

    Voxel normalisation, final activation and post-processing follow from that, as both were published; a checkpoint
    of another training may differ, and its owner says so by replacing the fields.
    """
    outputs = state["tail.weight"].shape[0]
    is_plus = outputs == 3
    return E2VIDConfig(
        bins=state["head.conv.weight"].shape[1],
        base_channels=state["head.conv.weight"].shape[0],
        residual_blocks=len({name.split(".")[1] for name in state if name.startswith("residuals.")}),
        outputs=outputs,
        final="none" if is_plus else "sigmoid",
        normalise_voxels=not is_plus,
        post_processing="none" if is_plus else "robust",
    )


def firenet_config_of(state: Mapping[str, Tensor], normalise_voxels: bool) -> FireNetConfig:
    """The configuration of a state dict (our names). `normalise_voxels`: true for FireNet, false for FireNet+."""
    channels, bins = state["head.weight"].shape[:2]
    return FireNetConfig(bins, channels, normalise_voxels)


def is_legacy_firenet(released: Mapping[str, Tensor]) -> bool:
    """Whether released names are those of the first FireNet, which wants normalised voxels."""
    return any(name.startswith("resblocks.0.recurrent_block.") for name in _unwrapped(released))


def fold_batch_norms(released: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Multiply batch norms, as they are at test time, into the convolutions before them; the rest stays as it is."""
    folded = dict(released)
    for name in released:
        for norm, convolution in _NORM_SITES:
            if not name.endswith(f"{norm}running_mean"):
                continue
            prefix = name.removesuffix(f"{norm}running_mean")
            parts = ("weight", "bias", "running_mean", "running_var")
            needed = [*(f"{prefix}{norm}{part}" for part in parts), f"{prefix}{convolution}weight"]
            missing = next((one for one in needed if one not in folded), None)
            if missing is not None:
                raise WeightsError(
                    f"parameter {name} belongs to no batch norm behind a convolution ({missing} is not there); "
                    "networks with batch norms or none can be converted, those with instance norms cannot"
                )
            gamma, beta, mean, variance = (folded.pop(f"{prefix}{norm}{part}").double() for part in parts)
            folded.pop(f"{prefix}{norm}num_batches_tracked", None)
            weight = folded[f"{prefix}{convolution}weight"]
            bias = folded.get(f"{prefix}{convolution}bias", torch.zeros(weight.shape[0])).double()
            gain = gamma / (variance + torch.nn.BatchNorm2d(1).eps).sqrt()
            folded[f"{prefix}{convolution}weight"] = (weight.double() * gain.view(-1, 1, 1, 1)).to(weight.dtype)
            folded[f"{prefix}{convolution}bias"] = ((bias - mean) * gain + beta).to(weight.dtype)
    return folded


def _unwrapped(released: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {_WRAPPERS.sub("", name): tensor for name, tensor in released.items()}


def _renamed(released: Mapping[str, Tensor], rules: _Rules, kind: str) -> dict[str, Tensor]:
    renamed: dict[str, Tensor] = {}
    for name, tensor in released.items():
        for pattern, ours in rules:
            found = re.match(pattern, name)
            if found is not None:
                renamed[found.expand(ours) + name[found.end() :]] = tensor
                break
        else:
            raise WeightsError(f"parameter {name} is in no released {kind}; name the architecture that it belongs to")
    return renamed
