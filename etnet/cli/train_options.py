"""The options of `etnet train`: a recipe with any of its fields changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from etnet.arguments import parsed
from etnet.training.config import TrainConfig, TrainingError
from etnet.training.recipes import RECIPES


@dataclass(frozen=True)
class Train:
    """A recipe, with any of its fields changed. A run that exists in `--out` is taken up where it stopped."""

    train: Annotated[TrainConfig, tyro.conf.arg(name="")]
    changed: bool = False
    """Go on although the run began under another configuration."""
    export: Path | None = None
    """Train nothing: write the running mean of the run's weights to this file (.safetensors, fp16)."""
    best: bool = False
    """Export the weights with the lowest validation LPIPS, not the last ones."""
    curves: Path | None = None
    """Train nothing: draw the run's losses and validation to this file (.svg)."""


def parse(arguments: Sequence[str], program: str) -> Train:
    """`--config NAME` chooses the recipe that all other options change; "half" without it."""
    rest = list(arguments)
    name = "half"
    if "--config" in rest:
        at = rest.index("--config")
        if at + 1 == len(rest) or rest[at + 1] not in RECIPES:
            got = rest[at + 1] if at + 1 < len(rest) else "nothing"
            raise TrainingError(f"--config is {got}; there are {', '.join(RECIPES)}")
        name = rest[at + 1]
        del rest[at : at + 2]
    default = Train(RECIPES[name])
    names = ",".join(RECIPES)
    return parsed(Train, f"{program} [--config {{{names}}}]", rest, default, beside=("--config",))
