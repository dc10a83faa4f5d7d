"""`etnet train`: train a network on clips that are simulated on the fly, or take up a run, or export its weights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from etnet.cli.progress import console

if TYPE_CHECKING:
    from etnet.cli.train_options import Train


def parse(arguments: Sequence[str], program: str) -> Train:
    """The options; apart from `run`, because the recipes they come from need torch."""
    from etnet.cli.train_options import parse

    return parse(arguments, program)


def run(config: Train) -> int:
    """Train or export; returns the exit code."""
    if config.export is not None:
        return _export(config.train.out, config.export, config.best)
    if config.curves is not None:
        return _draw(config.train.out, config.curves)
    if config.pack is not None:
        return _pack(config, config.pack)
    from etnet.training.distributed import joined
    from etnet.training.loop import train

    with joined(config.train.device) as world:
        report = _say if world.leads else None
        done = train(config.train, world, report, config.changed)
    if done.world.leads:
        end = "" if done.update == done.config.updates else f" of {done.config.updates}; the same command goes on"
        console.print(f"{config.train.out}: {done.update} updates{end}{_validated(done.best)}")
    return 0


def _export(folder: Path, target: Path, best: bool) -> int:
    from etnet.nets.weights import save_weights
    from etnet.training.export import exported

    model, card = exported(folder, best)
    save_weights(model, target, card)
    console.print(f"{target}: {card['title']}{_validated(card['best_validation_lpips'])}")
    return 0


def _validated(best: float | None) -> str:
    return f", best validation LPIPS {best:.4f}" if best is not None and math.isfinite(best) else ", never validated"


def _draw(folder: Path, target: Path) -> int:
    from etnet.files import write_atomically
    from etnet.training.plot import plot_runs

    write_atomically(target, plot_runs([folder]).encode())
    console.print(f"{target}: the curves of {folder}")
    return 0


def _pack(config: Train, folder: Path) -> int:
    from etnet.cli.train_options import command_line
    from etnet.training.pack import write_pack

    packed = write_pack(config.train, folder, int(1e6 * config.pack_megabytes), command_line, config.changed)
    if config.train.validation.recordings:
        console.print(f"{folder}: is validated on simulated clips alone; real recordings stay here")
    console.print(f"{folder}: {packed.sentence}; there: sh run.sh")
    return 0


def _say(kind: str, update: int, numbers: dict[str, Any]) -> None:
    if kind == "validation":
        conditions = "  ".join(f"{name} {value:.4f}" for name, value in numbers["lpips"].items())
        console.print(f"{update:>7}  validation LPIPS  {conditions}  grey {numbers['lpips_grey']:.4f}")
    else:
        names = ("total", "perceptual", "l1", "gradient_norm", "seconds_per_update")
        console.print(f"{update:>7}  " + "  ".join(f"{name} {numbers[name]:.4f}" for name in names))
