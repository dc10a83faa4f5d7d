"""Weights files: safetensors whose metadata hold everything that the tensors cannot tell."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from etnet.bundled import models
from etnet.errors import WeightsError
from etnet.files import replacing
from etnet.nets.listing import where_to_get
from etnet.nets.metadata import config_of_plain, parse_object
from etnet.nets.precision import PrecisionChoice, choose_runtime
from etnet.nets.presets import ARCHITECTURES, PRESETS, UNTRAINED, Network, build_model
from etnet.nets.runtime import apply_runtime

FORMAT = "etnet-weights-1"


def save_weights(
    model: nn.Module, path: Path, card: Mapping[str, Any] | None = None, dtype: torch.dtype | None = torch.float16
) -> None:
    """Write a model's weights, configuration and card to `path`, atomically; fp16 unless told otherwise."""
    config: Any = model.config
    metadata = {
        "format": FORMAT,
        "architecture": type(model).__name__,
        "config": json.dumps(dataclasses.asdict(config)),
        "card": json.dumps(dict(card or {})),
    }
    state = {name: tensor.detach().to("cpu", dtype).contiguous() for name, tensor in model.state_dict().items()}
    with replacing(path) as beside:
        try:
            save_file(state, beside, metadata)
        except SafetensorError as error:
            raise WeightsError(f"{path.name}: cannot be written ({error}); make room there") from None
        beside.chmod(0o644)


def read_card(path: Path) -> dict[str, Any]:
    """The card of a weights file: what it was trained on and what it expects; reads no tensor."""
    return _card(_metadata(path), path)


def load_weights(path: Path, device: str = "cpu") -> Network:
    """A model with the weights of a file, in fp32. Names the first parameter that is missing, unexpected or not finite.

    What the metadata claim is compared with the tensors that are there before anything of that size is allocated.
    """
    metadata = _metadata(path)
    architecture = metadata.get("architecture", "")
    if architecture not in ARCHITECTURES:
        raise WeightsError(f"{path.name}: is a {architecture[:60]!r}; known are {', '.join(ARCHITECTURES)}")
    config_type, model_type = ARCHITECTURES[architecture]
    plain = parse_object(metadata.get("config", ""), f"{path.name}: its configuration")
    config = config_of_plain(config_type, plain, path.name)
    card = _card(metadata, path)
    with safe_open(path, framework="pt", device="cpu") as file:
        shapes = {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}  # noqa: SIM118
        with torch.device("meta"):
            _check_fits(model_type(config), shapes, path.name)
        with torch.random.fork_rng(devices=[]):
            model = model_type(config)
        load_strictly(model, {name: file.get_tensor(name) for name in shapes}, path.name)
    model.name = path.stem
    model.card = card
    return model.eval().to(device)


def load_strictly(model: nn.Module, state: Mapping[str, Tensor], source: str) -> None:
    """Copy `state` into `model`; a name or shape that does not fit, or a number that is none, is an error that says
    which."""
    _check_fits(model, {name: tuple(tensor.shape) for name, tensor in state.items()}, source)
    expected = model.state_dict()
    converted = {name: tensor.to(expected[name].dtype) for name, tensor in state.items()}
    broken = next((name for name, tensor in converted.items() if not bool(torch.isfinite(tensor).all())), None)
    if broken is not None:
        count = int((~torch.isfinite(converted[broken])).sum())
        raise WeightsError(
            f"{source}: {broken} holds {count} of {converted[broken].numel()} values that are NaN or infinite; "
            "the file is damaged or its training diverged"
        )
    model.load_state_dict(converted)


def _check_fits(model: nn.Module, shapes: Mapping[str, tuple[int, ...]], source: str) -> None:
    expected = {name: tuple(tensor.shape) for name, tensor in model.state_dict().items()}
    missing = next((name for name in expected if name not in shapes), None)
    unexpected = next((name for name in shapes if name not in expected), None)
    if missing or unexpected:
        raise WeightsError(
            f"{source}: first missing parameter {missing}, first unexpected {unexpected}; "
            f"the file belongs to another configuration of {type(model).__name__}"
        )
    wrong = next((name for name in expected if expected[name] != shapes[name]), None)
    if wrong:
        raise WeightsError(f"{source}: {wrong} is {shapes[wrong]}, wanted {expected[wrong]}")


def load_model(
    name_or_path: str | Path = "etnet-half", device: str = "cpu", precision: PrecisionChoice = "fp32"
) -> Network:
    """A model ready to reconstruct: a preset's bundled weights or an untrained baseline by name, or a file by path.

    `precision` "auto" times one small encode and decode in fp32 and bf16 and keeps the faster.
    """
    untrained = UNTRAINED.get(str(name_or_path))
    model = load_weights(_find(name_or_path), device) if untrained is None else build_model(untrained).to(device)
    apply_runtime(model, choose_runtime(model, precision, device))
    for parameter in model.parameters():
        parameter.requires_grad_(False)
    return model


def _find(name_or_path: str | Path) -> Path:
    bundled = {path.stem: path for path in models()}
    if str(name_or_path) in bundled:
        return bundled[str(name_or_path)]
    path = Path(name_or_path)
    if path.suffix in (".pth", ".pt", ".tar"):
        raise WeightsError(
            f"{path.name}: is a torch checkpoint; convert it first: etnet convert {path.name} {path.stem}.safetensors"
        )
    if path.is_file():
        return path
    if str(name_or_path) in PRESETS:
        raise WeightsError(f"no weights for {name_or_path!r} are bundled; {where_to_get(str(name_or_path))}")
    raise WeightsError(f"{name_or_path}: no such weights file or model; bundled are {', '.join(bundled) or 'none'}")


def _card(metadata: Mapping[str, str], path: Path) -> dict[str, Any]:
    return parse_object(metadata.get("card", "{}"), f"{path.name}: its card")


def _metadata(path: Path) -> dict[str, str]:
    if path.exists() and not path.is_file():
        raise WeightsError(f"{path.name}: is no regular file; name a weights file (.safetensors)")
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
    except (SafetensorError, OSError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:200]
        raise WeightsError(f"{path.name}: not a safetensors file that can be read ({reason})") from None
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"{path.name}: its metadata say format {metadata.get('format', '')[:60]!r}, wanted {FORMAT!r}; "
            "make it with `etnet convert`, which stores what the tensors cannot tell"
        )
    return metadata
