"""Everything a training run is told, as frozen values: the dataclass is the command line and the checkpoint's key."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

from etnet.errors import EtnetError
from etnet.nets.etnet import ETNetConfig
from etnet.nets.presets import PRESETS
from etnet.nets.runtime import AttentionPath
from etnet.simulation.config import SceneConfig, SensorConfig

TrainPrecision = Literal["auto", "fp32", "bf16"]
TrainDevice = Literal["auto", "cpu", "cuda"]


class TrainingError(EtnetError):
    """A training run cannot start or go on as it was asked to."""


def _require(holds: bool, what: str) -> None:
    if not holds:
        raise TrainingError(what)


def named(folder: Path) -> Path:
    """A folder whose last part is a name: what ends in `.` or `..`, or says nothing, by its full path. A link keeps its
    own name."""
    return folder if folder.name not in ("", "..") else folder.resolve()


def network_preset(name: str) -> ETNetConfig:
    """The configuration of an ET-Net preset."""
    config = PRESETS[name]
    assert isinstance(config, ETNetConfig)
    return config


@dataclass(frozen=True, slots=True)
class Stage:
    """A stretch of updates at one clip size."""

    updates: int
    size: tuple[int, int] = (112, 112)
    """(h, w) in pixels."""
    clips: int = 2
    """Clips an update, over all processes."""

    def __post_init__(self) -> None:
        _require(self.updates >= 0, f"Stage.updates is {self.updates}; wanted at least 0 (0 leaves the stage out)")
        _require(self.clips >= 1, f"Stage.clips is {self.clips}; wanted at least 1")
        _require(min(self.size) >= 32, f"Stage.size is {self.size}; LPIPS wants at least 32 pixels a side")


@dataclass(frozen=True, slots=True)
class DataConfig:
    """Where clips come from. Without `photos` the scenes are made of random shapes and shading alone."""

    photos: Path | None = None
    cutouts: Path | None = None
    windows: int = 40
    """Windows a clip, T in the paper's eq. 5."""
    workers: int = 1
    """Processes that simulate ahead; 0 simulates between updates."""
    prefetch: int = 6
    """Clips that each worker keeps ready."""
    scene: SceneConfig = field(default_factory=SceneConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    target_tone: Literal["linear", "srgb"] = "linear"
    gamma_share: float = 0.0
    """How many clips show their frames in sRGB although `target_tone` is linear; they are judged after the best gain
    and offset of each frame, because the network cannot know the tone."""
    density: tuple[float, float] | None = None
    """Events per pixel and running window, drawn log-uniformly for each clip; without it as `scene` draws them.
    `scene.max_speed_px` and the thresholds decide how much of it is reached."""

    def __post_init__(self) -> None:
        # A run knows its folders of pictures by their names (`checkpoint.MOVABLE`), on any machine.
        for name in ("photos", "cutouts"):
            folder = getattr(self, name)
            object.__setattr__(self, name, None if folder is None else named(folder))
        _require(0 <= self.gamma_share <= 1, f"DataConfig.gamma_share is {self.gamma_share}; wanted a share in 0 … 1")
        if self.density is not None:
            low, high = self.density
            _require(0 < low <= high, f"DataConfig.density is {self.density}; wanted two ascending numbers above 0")
        _require(self.windows >= 1, f"DataConfig.windows is {self.windows}; wanted at least 1")
        _require(self.workers >= 0 and self.prefetch >= 1, "DataConfig.workers is at least 0, prefetch at least 1")


@dataclass(frozen=True, slots=True)
class AugmentConfig:
    """What is done to a clip's voxel grids beyond the simulated sensor's own faults (Stoffregen et al. 2020)."""

    flips: bool = True
    noise_std: tuple[float, float] = (0.0, 0.1)
    """Standard deviation of Gaussian noise on every bin of a clip, drawn evenly; the paper's is always .1."""
    hot_pixel_share: float = 0.0
    """Hot pixels a clip: their share of all pixels is drawn evenly up to this. The simulated sensor has its own."""
    hot_pixel_std: float = 0.1

    def __post_init__(self) -> None:
        low, high = self.noise_std
        _require(0 <= low <= high, f"AugmentConfig.noise_std is {self.noise_std}; wanted two ascending numbers")
        _require(0 <= self.hot_pixel_share <= 1, "AugmentConfig.hot_pixel_share is a share in 0 … 1")


@dataclass(frozen=True, slots=True)
class ContextConfig:
    """What makes the upsampler need TPA, and TPA need its attention (ours; `docs/training.md` says why).

    `blind_share` of the updates hide squares of tokens, `blind_tokens` a side, from TPA and the skips of levels 1 … 3
    in `blind_squares` places a frame: what lies there can only be told from elsewhere.
    """

    skip_drop: float = 0.75
    """Probability that an update goes without the skips from level 1, 2 or 3 (as likely each, as far as the network has
    them) downwards, at first …"""
    skip_drop_end: float = 0.3
    """… and from `skip_drop_updates` on. Skips that are always there carry the whole picture, and TPA is left to be a
    constant."""
    skip_drop_updates: int = 4000
    blind_share: float = 0.5
    blind_tokens: tuple[int, int] = (3, 9)
    blind_squares: tuple[int, int] = (1, 2)
    without_context: bool = False
    """TPA's output is zero in every update: the control that tells what TPA is worth."""
    sensor_rows: tuple[int, int] = (14, 90)
    """Token rows of the imagined sensor that a crop is placed on."""
    sensor_columns: tuple[int, int] = (14, 160)

    def __post_init__(self) -> None:
        for name in ("skip_drop", "skip_drop_end", "blind_share"):
            value = getattr(self, name)
            _require(0 <= value <= 1, f"ContextConfig.{name} is {value}; wanted a share in 0 … 1")
        for name in ("blind_tokens", "blind_squares", "sensor_rows", "sensor_columns"):
            low, high = getattr(self, name)
            _require(1 <= low <= high, f"ContextConfig.{name} is {(low, high)}; wanted two ascending counts")


@dataclass(frozen=True, slots=True)
class LossConfig:
    """Weights of the terms (paper, eq. 5, with λ = `temporal`); L1 terms are ours, on values in 0 … 1."""

    perceptual: float = 1.0
    l1: float = 0.5
    gradient: float = 0.5
    """L1 between the images' differences of neighbours."""
    tone: float = 1.0
    """L1 between the images' means over a token's 8 × 8 pixels: what can only be told from far away."""
    context: float = 0.0
    """L1 between the image and what a linear layer reads off TPA's output alone (`context_reader.py`)."""
    alive: float = 0.0
    """What keeps the upsampler's units from falling silent: see `losses.silence`."""
    temporal: float = 0.0
    temporal_from: int = 2
    """First window of a clip at which temporal consistency counts (L0 in eq. 5)."""
    temporal_after: int = 0
    """First update at which temporal consistency counts."""
    num_scored: int = 4
    """Frames decoded and scored of each truncated stretch; 0 means all."""


@dataclass(frozen=True, slots=True)
class OptimiserConfig:
    """How gradients become steps, and the learning rate."""

    kind: Literal["adamw", "muon"] = "adamw"
    """"adamw" as in the paper; "muon": steps of equal size in every direction of a matrix (`optimiser.py`)."""
    learning_rate: float = 3e-4
    schedule: Literal["cosine", "trapezoid", "exponential"] = "cosine"
    """"cosine" falls to `final_share` of the rate over the whole run; "trapezoid" stays and falls over the last
    `cool_down` updates, so that a run can be made longer while it goes; "exponential" is × `decay` every
    `decay_updates` (the paper's)."""
    warm_up: int = 200
    cool_down: int = 1500
    final_share: float = 0.02
    decay: float = 0.99
    decay_updates: int = 5600
    weight_decay: float = 0.01
    clip_norm: float = 1.0
    """Largest gradient norm."""
    ema: float = 0.999
    """Share of the running mean of the weights that stays at each update; less at first."""

    def __post_init__(self) -> None:
        _require(self.learning_rate > 0, f"OptimiserConfig.learning_rate is {self.learning_rate}; wanted above 0")
        _require(0 <= self.ema < 1, f"OptimiserConfig.ema is {self.ema}; wanted 0 … below 1")
        _require(self.clip_norm > 0, f"OptimiserConfig.clip_norm is {self.clip_norm}; wanted above 0")


@dataclass(frozen=True, slots=True)
class ValidationConfig:
    """The fixed clips that are scored now and then: held-out pictures and fixed seeds, at sensor size."""

    every: int = 100
    """Updates from one validation to the next; 0 never."""
    clips: int = 3
    windows: int = 20
    size: tuple[int, int] = (180, 240)
    score_every: int = 4
    """Every how many windows a frame is decoded and scored."""
    seed: int = 7_000_000
    other_densities: tuple[float, ...] = ()
    """Events per pixel and window of clips from a second, independent generator (`other_scenes.py`): affine LPIPS is
    logged by density."""
    recordings: tuple[Path, ...] = ()
    """Real recordings with frames that are scored beside the clips (never the test sequence)."""

    def __post_init__(self) -> None:
        _require(self.every >= 0, f"ValidationConfig.every is {self.every}; wanted at least 0 (0 is never)")
        _require(self.score_every >= 1, f"ValidationConfig.score_every is {self.score_every}; wanted at least 1")


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """One training run."""

    out: Path
    """Folder for checkpoints, log and previews."""
    network: ETNetConfig = field(default_factory=lambda: network_preset("etnet-half"))
    start: Path | None = None
    """Weights to begin with, whose parts that fit are taken; fresh ones else."""
    initialise: Literal["default", "local", "local-attention", "upsampler"] = "default"
    """"local": TPA and half of the upsampler start fresh, attention looking about itself; "local-attention": attention
    alone does; "upsampler": its blocks alone start fresh (`initialise.py`)."""
    stages: tuple[Stage, ...] = (Stage(10_000),)
    truncate: int = 10
    """Windows that gradients run back through."""
    data: DataConfig = field(default_factory=DataConfig)
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    context: ContextConfig = field(default_factory=ContextConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)
    validation: ValidationConfig = field(default_factory=ValidationConfig)
    seed: int = 0
    precision: TrainPrecision = "fp32"
    """"auto": bf16 where a trial update is faster in it. A run that is taken up keeps what was chosen."""
    device: TrainDevice = "cpu"
    """Where the network is trained; clips are simulated by processors in any case. "auto": a GPU where there is one. A
    run may be taken up on another device than it began on."""
    attention: AttentionPath = "plain"
    channels_last: bool = False
    threads: int = 1
    minutes: float | None = None
    """The run ends after so many minutes, start included, and is taken up like any other. What an update does, its
    learning rate too, never depends on it."""
    log_every: int = 100
    checkpoint_every: int = 50

    def __post_init__(self) -> None:
        _require(
            not self.network.normalise_voxels,
            "network.normalise_voxels is set; clips are given as they are, and the network would later be fed what it "
            "never saw: leave it out",
        )
        for name in ("log_every", "checkpoint_every"):
            _require(getattr(self, name) >= 1, f"TrainConfig.{name} is {getattr(self, name)}; wanted at least 1")
        _require(self.updates >= 1, "TrainConfig.stages hold no update; wanted at least one Stage with one")
        _require(
            1 <= self.truncate <= self.data.windows and self.data.windows % self.truncate == 0,
            f"TrainConfig.truncate is {self.truncate}; it has to divide the {self.data.windows} windows of a clip",
        )
        _require(
            self.loss.num_scored <= self.truncate,
            f"LossConfig.num_scored is {self.loss.num_scored}; a stretch has only {self.truncate} windows",
        )
        _require(self.minutes is None or self.minutes > 0, f"TrainConfig.minutes is {self.minutes}; wanted more than 0")
        _require(self.threads >= 1, f"TrainConfig.threads is {self.threads}; wanted at least 1")

    @property
    def updates(self) -> int:
        """Updates of all stages together."""
        return sum(stage.updates for stage in self.stages)

    def stage_at(self, update: int) -> tuple[int, int]:
        """(index of the stage, updates done in it) at an update counted from 0."""
        for index, stage in enumerate(self.stages):
            if update < stage.updates:
                return index, update
            update -= stage.updates
        raise TrainingError(f"the run ends after {self.updates} updates; there is no update {update + self.updates}")

    def as_plain(self) -> dict[str, object]:
        """As JSON knows it: for checkpoints and logs."""
        return {name: _plain(value) for name, value in asdict(self).items()}


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value
