"""A run so small that a test can afford several."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from etnet.simulation.config import SceneConfig
from etnet.training.config import (
    DataConfig,
    LossConfig,
    OptimiserConfig,
    Stage,
    TrainConfig,
    ValidationConfig,
    network_preset,
)


def micro(out: Path, **changes: object) -> TrainConfig:
    """4-channel network, 40 × 48 pixels, 4 windows a clip in stretches of 2, no workers."""
    config = TrainConfig(
        out=out,
        network=replace(network_preset("tiny"), positions="grid"),
        initialise="local",
        stages=(Stage(6, size=(40, 48)),),
        truncate=2,
        data=DataConfig(windows=4, workers=0, scene=SceneConfig(num_objects=(0, 2))),
        loss=LossConfig(num_scored=1),
        optimiser=OptimiserConfig(warm_up=2),
        validation=ValidationConfig(every=0),
        checkpoint_every=3,
        log_every=2,
    )
    return replace(config, **changes)  # pyright: ignore[reportArgumentType]
