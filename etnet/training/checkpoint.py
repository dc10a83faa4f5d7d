"""Checkpoints that are whole or not there at all, from which a run goes on to the same bits."""

# pyright: reportPrivateImportUsage=false
# There is no public name for torch's _foreach functions.
from __future__ import annotations

import copy
import pickle
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from etnet.files import replacing
from etnet.training.config import TrainConfig, TrainingError, named

LAST = "last.pt"
BEST = "best.pt"


class RunningMean:
    """An exponential moving average of a network's weights, quick at first: min(share, (1 + n) / (10 + n))."""

    def __init__(self, model: nn.Module, share: float) -> None:
        self.share = share
        self.weights = {name: value.detach().clone() for name, value in model.state_dict().items()}

    @torch.no_grad()
    def take(self, model: nn.Module, update: int) -> None:
        """Move towards the model's weights after its `update`-th update (from 1)."""
        share = min(self.share, (1 + update) / (10 + update))
        now = model.state_dict()
        torch._foreach_lerp_([self.weights[name] for name in now], list(now.values()), 1 - share)

    def model(self, model: nn.Module) -> nn.Module:
        """A copy of the model with the averaged weights."""
        averaged = copy.deepcopy(model)
        averaged.load_state_dict(self.weights)
        return averaged.eval()


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """All that the rest of a run depends on, beside its config. `update` counts updates done."""

    update: int
    config: dict[str, Any]
    weights: Mapping[str, Tensor]
    averaged: Mapping[str, Tensor]
    reader: Mapping[str, Tensor]
    optimiser: dict[str, Any]
    memory: tuple[Tensor, ...]
    """The recurrent state carried to the next update, of all processes' clips; empty before the first update."""
    best: float
    """Lowest validation LPIPS so far on the clips and recordings that `config` names."""


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write beside, flush to the disk, then rename: a kill at any moment leaves the old file or the new one."""
    with replacing(path) as beside, open(beside, "wb") as file:
        torch.save({name: getattr(checkpoint, name) for name in checkpoint.__dataclass_fields__}, file)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint; runs no code that it may hold."""
    try:
        return Checkpoint(**torch.load(path, map_location="cpu", weights_only=True))
    except (OSError, RuntimeError, EOFError, TypeError, pickle.UnpicklingError) as error:
        raise TrainingError(f"{path}: not a checkpoint of a run ({error}); remove it or name another folder") from error


def check_finite(checkpoint: Checkpoint) -> None:
    """Raise if a weight, or its running mean, is NaN or infinite: from there no run can go on."""
    for weights in (checkpoint.weights, checkpoint.averaged):
        broken = next((name for name, value in weights.items() if not bool(torch.isfinite(value).all())), None)
        if broken is not None:
            raise TrainingError(
                f"update {checkpoint.update}: the run has diverged ({broken} is no longer finite), and this is not "
                f"saved; take up the {LAST} from before with a lower --optimiser.learning-rate and --changed"
            )


CHANGEABLE = (
    "out", "validation", "device", "threads", "minutes", "log_every", "checkpoint_every", "start", "initialise",
    "data.workers", "data.prefetch",
)  # fmt: skip
"""Fields that may differ when a run is taken up: they change no weight that is still to come."""
_OF_TRAINING = "dropout"
"""Of the network's fields the one that acts in training alone and has no weights."""
_OF_NO_SCORE = (
    "validation.every", "validation.other_densities",
    "data.density", "data.gamma_share", "data.workers", "data.prefetch",
)  # fmt: skip
"""Fields of validation and data that change no validation LPIPS."""
MOVABLE = ("data.photos", "data.cutouts")
"""Folders that may lie elsewhere when a run is taken up: their own names count."""


def check_same_run(config: TrainConfig, checkpoint: Checkpoint, path: Path) -> None:
    """Raise unless the checkpoint was made under this config (`CHANGEABLE` fields aside)."""
    now, then = _comparable(config.as_plain()), _comparable(checkpoint.config)
    changed = [name for name in now if now[name] != then.get(name)]
    if changed:
        raise TrainingError(
            f"{path}: was made with another {', '.join(changed)}; give the same, another --out, "
            "or go on from it on purpose with --changed"
        )


def check_continues(config: TrainConfig, checkpoint: Checkpoint, path: Path) -> None:
    """Raise if weights and moments of the checkpoint cannot be gone on from under this config, however it is meant."""
    then = checkpoint.config
    kind = then.get("optimiser", {}).get("kind", config.optimiser.kind)
    network = config.as_plain()["network"]
    assert isinstance(network, dict)
    before = {name: value for name, value in then.get("network", {}).items() if name != _OF_TRAINING}
    other = [f"network.{name}" for name, value in before.items() if network.get(name, value) != value]
    other += ["optimiser.kind"] * (kind != config.optimiser.kind)
    if other:
        raise TrainingError(
            f"{path}: was made with another {', '.join(other)}, which --changed cannot change; begin a run in another "
            "--out, from its weights (--start)"
        )


def validates_alike(config: TrainConfig, checkpoint: Checkpoint) -> bool:
    """Whether this config scores the very clips and recordings that the checkpoint's `best` was told from."""
    now, then = (
        _comparable({part: plain.get(part) for part in ("validation", "data")}, left_out=_OF_NO_SCORE)
        for plain in (config.as_plain(), checkpoint.config)
    )
    return now == then


def _comparable(
    plain: Mapping[str, object], before: str = "", left_out: Collection[str] = CHANGEABLE
) -> dict[str, object]:
    """Each field under its whole name, "data.density", as far as it makes a run another."""
    found: dict[str, object] = {}
    for field, value in plain.items():
        name = before + field
        if name in left_out:
            continue
        if isinstance(value, Mapping):
            found |= _comparable(value, f"{name}.", left_out)
        else:
            found[name] = named(Path(value)).name if name in MOVABLE and isinstance(value, str) else value
    return found
