"""`etnet train`: train a network on clips that are simulated on the fly, or take up a run, or export its weights."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro

from etnet.cli.progress import console
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
    return tyro.cli(Train, default=default, args=rest, prog=f"{program} [--config {{{names}}}]")


def run(config: Train) -> int:
    """Train or export; returns the exit code."""
    if config.export is not None:
        return _export(config.train.out, config.export, config.best)
    from etnet.training.distributed import joined
    from etnet.training.loop import train

    with joined() as world:
        report = _say if world.leads else None
        done = train(config.train, world, report, config.changed)
    if done.world.leads:
        console.print(f"{config.train.out}: {done.update} updates, best validation LPIPS {done.best:.4f}")
    return 0


def _export(folder: Path, target: Path, best: bool) -> int:
    from etnet.nets.weights import save_weights
    from etnet.training.export import exported

    model, card = exported(folder, best)
    save_weights(model, target, card)
    console.print(f"{target}: {json.dumps(card)}")
    return 0


def _say(kind: str, update: int, numbers: dict[str, Any]) -> None:
    if kind == "validation":
        conditions = "  ".join(f"{name} {value:.4f}" for name, value in numbers["lpips"].items())
        console.print(f"{update:>7}  validation LPIPS  {conditions}  grey {numbers['lpips_grey']:.4f}")
    else:
        names = ("total", "perceptual", "l1", "gradient_norm", "seconds_per_update")
        console.print(f"{update:>7}  " + "  ".join(f"{name} {numbers[name]:.4f}" for name in names))
