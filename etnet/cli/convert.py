"""`etnet convert IN OUT`: a released checkpoint, or a trainer's, becomes a weights file of ours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from etnet.cli.progress import console
from etnet.errors import EtnetError


@dataclass(frozen=True)
class Convert:
    """Read a checkpoint without running anything in it, and write safetensors with all that a model needs."""

    source: tyro.conf.Positional[Path]
    """A torch checkpoint (.pth, .pth.tar) of the released ET-Net, E2VID, E2VID+, FireNet, FireNet+ or PIE-Net."""
    target: tyro.conf.Positional[Path]
    """The weights file to write (.safetensors)."""
    heads: int = 8
    """ET-Net's attention heads: the one thing no tensor's shape tells."""
    dtype: Literal["fp32", "fp16"] = "fp32"
    """fp32 keeps the checkpoint's frames to the last digit."""
    overwrite: bool = False
    """Replace the target if it is there."""


def run(config: Convert) -> int:
    """Do it; returns the exit code."""
    import torch

    from etnet.nets.convert import convert_checkpoint
    from etnet.nets.weights import save_weights

    if config.target.exists() and not config.overwrite:
        raise EtnetError(f"{config.target}: is there already; give another name, or --overwrite")
    model, what = convert_checkpoint(config.source, config.heads)
    save_weights(model, config.target, model.card, torch.float16 if config.dtype == "fp16" else torch.float32)
    console.print(f"{config.target}: {what}")
    return 0
