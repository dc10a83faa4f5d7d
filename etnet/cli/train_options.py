"""The options of `etnet train`: a recipe with any of its fields changed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any

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
    pack: Path | None = None
    """Train nothing: write the run as a folder from which a machine without internet trains (there: sh run.sh)."""
    pack_megabytes: float = 40
    """Photos and cut-outs take at most so many million bytes of `--pack`; they are coded again where they would not."""


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


def command_line(config: TrainConfig) -> list[str]:
    """The options that `parse` makes this config of: the nearest recipe, and what differs from it."""
    alike = {name: recipe for name, recipe in RECIPES.items() if len(recipe.stages) == len(config.stages)}
    assert alike, "the command line changes a recipe's stages, not how many there are"
    told = {name: list(_differing(config, recipe)) for name, recipe in alike.items()}
    nearest = min(told, key=lambda name: len(told[name]))
    return ["--config", nearest, *(word for option in told[nearest] for word in option)]


def _differing(value: Any, default: Any, name: str = "") -> Iterator[list[str]]:
    """One option, as its words, for each field that differs."""
    if is_dataclass(value):
        for field in fields(value):
            inner = f"{name}.{field.name}" if name else field.name
            yield from _differing(getattr(value, field.name), getattr(default, field.name), inner)
    elif isinstance(value, tuple) and value and is_dataclass(value[0]):
        for index, (item, standard) in enumerate(zip(value, default, strict=True)):
            yield from _differing(item, standard, f"{name}.{index}")
    elif value != default:
        before, _, last = name.replace("_", "-").rpartition(".")
        is_off = value is False
        option = f"--{before}{'.' if before else ''}{'no-' if is_off else ''}{last}"
        values = [] if isinstance(value, bool) else value if isinstance(value, tuple) else [value]
        yield [option, *map(str, values)]
