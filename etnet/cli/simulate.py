"""`etnet simulate OUT --photos FOLDER`: let pictures move before a modelled sensor; writes events, frames and flow."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from etnet.cli.progress import console, fraction_callback
from etnet.simulation.config import SceneConfig, SensorConfig, SequenceConfig
from etnet.simulation.dataset import write_dataset
from etnet.simulation.pictures import PicturePool, Split


@dataclass(frozen=True)
class Simulate:
    """Let pictures move before a modelled event sensor and write what it sees (event_utils HDF5, with frames and flow).

    Finished files are kept: the same command goes on where it was stopped.
    """

    out: tyro.conf.Positional[Path]
    """Folder for sequence_00000.h5, sequence_00001.h5 …"""
    photos: Path
    """Folder of photos (.jpg, .png, .webp)."""
    cutouts: Path | None = None
    """Folder of cut-out objects: pictures with an alpha channel."""
    num: int = 280
    """How many recordings."""
    seconds: float = 10.0
    """Length of each."""
    size: tuple[int, int] = (256, 256)
    """Width and height in pixels."""
    fps: float = 25.0
    """Frames a second of the ordinary camera; a window is the time between two."""
    seed: int = 0
    """Recording i depends on the pictures, the options, this and i alone."""
    split: Split = "train"
    """Which photos: one in ten is held out, by the hash of its file name."""
    flow: bool = True
    """Store the optical flow; it is most of a file."""
    scene: SceneConfig = field(default_factory=SceneConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)

    def __post_init__(self) -> None:
        for name in ("num", "seconds", "fps"):
            if not getattr(self, name) > 0:
                raise ValueError(f"--{name} is {getattr(self, name)}; wanted a number above 0")

    @property
    def sequence(self) -> SequenceConfig:
        """One recording: all windows of one length, as a camera's frames are."""
        width, height = self.size
        return SequenceConfig(
            size=(height, width),
            num_windows=max(1, round(self.seconds * self.fps)),
            window_us=1e6 / self.fps,
            clip_jitter=(1.0, 1.0),
            jittered_share=0.0,
            scene=self.scene,
            sensor=self.sensor,
        )


def run(config: Simulate) -> int:
    """Write the recordings; 0 when all are there."""
    with fraction_callback("pictures") as progress:
        pictures = PicturePool.from_folder(config.photos, config.cutouts, config.split, progress=progress)
    with fraction_callback("recordings") as progress:
        write_dataset(config.out, pictures, config.sequence, config.num, config.seed, config.flow, progress)
    console.print(f"{config.num} recordings in {config.out}")
    return 0
