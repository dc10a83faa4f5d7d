"""Training runs by name: the paper's, ours for two cores, and a tiny one for tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from etnet.simulation.config import SceneConfig, SensorConfig
from etnet.training.config import (
    AugmentConfig,
    ContextConfig,
    DataConfig,
    LossConfig,
    OptimiserConfig,
    Stage,
    TrainConfig,
    ValidationConfig,
    network_preset,
)

_NO_HELP = ContextConfig(
    skip_drop=0.0, skip_drop_end=0.0, blind_share=0.0, sensor_rows=(14, 14), sensor_columns=(14, 14)
)

PAPER = TrainConfig(
    out=Path("runs/paper"),
    network=network_preset("etnet"),
    stages=(Stage(280 // 2 * 300, clips=2),),
    truncate=40,
    data=DataConfig(
        sensor=SensorConfig(threshold_core_share=0.0, balance="normal", balance_sigma=0.1),
        scene=SceneConfig(num_objects=(0, 30), pause_start=0.05, pause_stay=0.9, long_pause_stay=0.9),
        target_tone="srgb",
    ),
    augment=AugmentConfig(noise_std=(0.1, 0.1), hot_pixel_share=0.001),
    context=_NO_HELP,
    loss=LossConfig(l1=0.0, gradient=0.0, tone=0.0, temporal=1.0, num_scored=0),
    optimiser=OptimiserConfig(
        learning_rate=2e-4, schedule="exponential", decay_updates=140, warm_up=0, clip_norm=1e9, ema=0.0
    ),
)
"""Weng et al. 2021, §3.3 and §4.1, on endless fresh clips instead of 280: batch 2, all 40 windows in one gradient."""

HALF = TrainConfig(
    out=Path("runs/half"),
    network=network_preset("etnet-half"),
    initialise="local",
    stages=(Stage(20_000), Stage(2_000, size=(184, 240), clips=1)),
    data=DataConfig(
        scene=SceneConfig(
            smooth_share=0.12,
            straight_share=0.3,
            blur_px=(0.0, 0.6),
            exposure=(0.12, 0.55),
            density=0.45,
            density_sigma=0.55,
            pause_start=0.01,
        ),
        sensor=SensorConfig(
            threshold_core_share=0.95, balance_sigma=0.2, balance_center=1.25, mismatch=(0.0, 0.06), shot_hz=(0.0, 0.3)
        ),
    ),
    augment=AugmentConfig(noise_std=(0.0, 0.05)),
    context=ContextConfig(skip_drop=0.85, skip_drop_end=0.2, skip_drop_updates=1500, blind_share=0.1),
    loss=LossConfig(context=1.0, alive=0.2),
    optimiser=OptimiserConfig(kind="muon", learning_rate=1e-3, schedule="trapezoid", warm_up=50),
)
"""Half width, for two cores. `docs/training.md` has the reasons for every number."""

WIDE = replace(
    HALF,
    out=Path("runs/wide"),
    initialise="default",
    stages=(Stage(20_000),),
    data=replace(
        HALF.data,
        density=(0.05, 5.0),
        gamma_share=0.25,
        scene=replace(HALF.data.scene, blur_px=(0.0, 0.3), exposure=(0.08, 0.7), max_speed_px=30.0, pause_start=0.02),
        sensor=replace(
            HALF.data.sensor,
            threshold_core=(0.1, 1.0),
            threshold_core_share=0.9,
            balance_center=1.15,
            balance_sigma=0.25,
        ),
    ),
    context=replace(HALF.context, skip_drop=0.3, skip_drop_end=0.3, blind_share=0.2),
    optimiser=replace(HALF.optimiser, learning_rate=6e-4, warm_up=30, cool_down=19_970, ema=0.998),
    validation=replace(HALF.validation, every=2000, other_densities=(0.1, 0.3, 1.0, 2.0, 5.0)),
    precision="auto",
)
"""On from the bundled weights (`--start`), to where they are weak: dense windows, gamma-coded scenes, attention."""

TINY = TrainConfig(
    out=Path("runs/tiny"),
    network=replace(network_preset("tiny"), positions="grid", dropout=0.0),
    initialise="local",
    stages=(Stage(200, size=(64, 64)),),
    truncate=5,
    data=DataConfig(windows=20, workers=1),
    loss=LossConfig(num_scored=3),
    context=ContextConfig(skip_drop_updates=100),
    optimiser=OptimiserConfig(learning_rate=2e-3, warm_up=20, ema=0.99),
    validation=ValidationConfig(every=100, clips=4, windows=16, size=(64, 80)),
    log_every=50,
)
"""Learns in two minutes on two cores, without any file."""

RECIPES: dict[str, TrainConfig] = {"paper": PAPER, "half": HALF, "wide": WIDE, "tiny": TINY}
