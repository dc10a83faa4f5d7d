"""`etnet simulate OUT --photos FOLDER | --video FILE`: let pictures move, or a video run, before a modelled sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from etnet.cli.filming import Filming, given_options
from etnet.cli.many import this_share
from etnet.cli.progress import console, fraction_callback
from etnet.cli.simulate_video import Filmed, run_video
from etnet.errors import EtnetError
from etnet.simulation.config import SceneConfig, SensorConfig, SequenceConfig
from etnet.simulation.dataset import write_dataset
from etnet.simulation.pictures import PicturePool, Split


@dataclass(frozen=True)
class Simulate:
    """Let pictures move before a modelled event sensor and write what it sees (event_utils HDF5, with frames and flow).

    Finished files are kept: the same command goes on where it was stopped, and another one, of other pictures, say, is
    refused there. With --video the sensor sees a video, pictures or a photo instead, and OUT is one file of any format
    that we write; of several videos, a folder.
    """

    out: tyro.conf.Positional[Path]
    """Folder for sequence_00000.h5, sequence_00001.h5 …; with --video the file to write, or the folder of several."""
    photos: Path | None = None
    """Folder of photos (.jpg, .png, .webp)."""
    cutouts: Path | None = None
    """Folder of cut-out objects: pictures with an alpha channel."""
    num: int = 280
    """How many recordings."""
    seconds: float | None = None
    """Length of each, 10 by default; with --motion that of the motion, 0.3 by default."""
    size: tuple[int, int] | None = None
    """Width and height in pixels, 256×256 by default; with --video the pictures are cut to this shape, by default those
    of the camera or of the pictures."""
    fps: float | None = None
    """Frames a second of the ordinary camera, 25 by default; of a folder of pictures, that they were taken at."""
    seed: int = 0
    """Recording i depends on the pictures, the options, this and i alone."""
    split: Split = "train"
    """Which photos: one in ten is held out, by the hash of its file name."""
    flow: bool = True
    """Store the optical flow; it is most of a file."""
    scene: SceneConfig = field(default_factory=SceneConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    filming: Annotated[Filming, tyro.conf.arg(name="")] = field(default_factory=Filming)

    def __post_init__(self) -> None:
        for name in ("num", "seconds", "fps"):
            if (value := getattr(self, name)) is not None and not 0 < value < math.inf:
                raise ValueError(f"--{name} is {getattr(self, name)}; wanted a finite number above 0")
        if self.filming.video:
            return
        if self.size is not None and min(self.size) < 8:
            raise ValueError(f"--size is {self.size[0]}×{self.size[1]}; wanted at least 8 pixels a side")
        if self.fps is not None and self.fps > 10_000:
            raise ValueError(f"--fps is {self.fps:g}; wanted at most 10,000")

    @property
    def sequence(self) -> SequenceConfig:
        """One recording: all windows of one length, as a camera's frames are."""
        width, height = self.size or (256, 256)
        fps, seconds = self.fps or 25.0, self.seconds or 10.0
        return SequenceConfig(
            size=(height, width),
            num_windows=max(1, round(seconds * fps)),
            window_us=1e6 / fps,
            clip_jitter=(1.0, 1.0),
            jittered_share=0.0,
            scene=self.scene,
            sensor=self.sensor,
        )


def run(config: Simulate) -> int:
    """Write the recordings; 0 when all are there."""
    if config.filming.video:
        if config.photos is not None:
            raise EtnetError("--photos and --video do not go together; give one of them")
        _refuse_of_photos(config)
        return run_video(config.filming, config.out, Filmed(config.seed, config.size, config.fps, config.seconds))
    if config.photos is None:
        raise EtnetError("there is nothing to simulate: give --photos FOLDER, or --video FILE")
    if foreign := given_options(config.filming):
        raise EtnetError(f"{', '.join(foreign)}: of --video, not of --photos; leave it out")
    with fraction_callback("pictures") as progress:
        pictures = PicturePool.from_folder(config.photos, config.cutouts, config.split, progress=progress)
    with fraction_callback("recordings") as progress:
        share = this_share()
        what = (config.out, pictures, config.sequence, config.num, config.seed, config.flow)
        paths = write_dataset(*what, progress, (share.rank, share.size))
    console.print(f"{len(paths)} recordings in {config.out}")
    return 0


def _refuse_of_photos(config: Simulate) -> None:
    """What decides about scenes made of photos says nothing of a video."""
    given = {
        "--cutouts": config.cutouts is not None,
        "--num": config.num != Simulate.num,
        "--split": config.split != Simulate.split,
        "--no-flow": not config.flow,
        "--scene.…": config.scene != SceneConfig(),
        "--sensor.…": config.sensor != SensorConfig(),
    }
    if foreign := [name for name, is_given in given.items() if is_given]:
        raise EtnetError(f"{', '.join(foreign)}: of --photos, not of --video; leave it out")
