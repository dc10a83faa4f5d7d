"""A run's averaged weights as a network with a card."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from etnet.nets.etnet import ETNet, ETNetConfig
from etnet.nets.presets import num_parameters
from etnet.nets.weights import load_strictly
from etnet.training.checkpoint import BEST, LAST, load_checkpoint
from etnet.training.config import TrainingError


def exported(folder: Path, best: bool = False) -> tuple[ETNet, dict[str, Any]]:
    """The running mean of a run's weights (the last, or the best by validation LPIPS), and what the card says."""
    path = folder / (BEST if best else LAST)
    if not path.exists():
        raise TrainingError(f"{path}: no such checkpoint; train first, or name the run's folder with --out")
    checkpoint = load_checkpoint(path)
    model = ETNet(ETNetConfig(**checkpoint.config["network"])).eval()
    load_strictly(model, checkpoint.averaged, path.name)
    card = {
        "title": f"ET-Net, {num_parameters(model):,} parameters, {checkpoint.update} updates",
        "updates": checkpoint.update,
        "best_validation_lpips": checkpoint.best if math.isfinite(checkpoint.best) else None,
        "target_tone": checkpoint.config["data"]["target_tone"],
        "seed": checkpoint.config["seed"],
        "recipe": {name: _without_folders(value) for name, value in checkpoint.config.items() if name != "out"},
    }
    return model, card


def _without_folders(value: object) -> object:
    """Files by their names alone: where they lay on one machine is nobody's business."""
    if isinstance(value, dict):
        return {name: _without_folders(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_without_folders(item) for item in value]
    return Path(value).name if isinstance(value, str) and "/" in value else value
