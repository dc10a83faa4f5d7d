"""`etnet simulate OUT --photos FOLDER | --video FILE`: let pictures move, or a video run, before a modelled sensor."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import tyro

from etnet.cli.progress import console, fraction_callback
from etnet.errors import EtnetError
from etnet.simulation.config import SceneConfig, SensorConfig, SequenceConfig
from etnet.simulation.dataset import write_dataset
from etnet.simulation.pictures import PicturePool, Split
from etnet.simulation.video import VideoConfig, simulate_video


@dataclass(frozen=True)
class Simulate:
    """Let pictures move before a modelled event sensor and write what it sees (event_utils HDF5, with frames and flow).

    Finished files are kept: the same command goes on where it was stopped. With --video the sensor sees a video
    instead, and OUT is one file.
    """

    out: tyro.conf.Positional[Path]
    """Folder for sequence_00000.h5, sequence_00001.h5 …; with --video the file to write."""
    photos: Path | None = None
    """Folder of photos (.jpg, .png, .webp)."""
    video: Path | None = None
    """A video (.mp4 …). Of what follows only contrast, noise, side, speed and seed matter then."""
    contrast: float = 0.2
    """With --video: change of natural-log intensity that makes an event."""
    noise: float = 0.2
    """With --video: 0 is an ideal sensor, 1 a mediocre one."""
    side: int = 320
    """With --video: pixels of the longer side, at most."""
    speed: float = 1.0
    """With --video: how much faster the scene runs before the sensor; of ×8 slow motion say 8."""
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
    if config.video is not None:
        return _run_video(config, config.video)
    if config.photos is None:
        raise EtnetError("there is nothing to simulate: give --photos FOLDER, or --video FILE")
    with fraction_callback("pictures") as progress:
        pictures = PicturePool.from_folder(config.photos, config.cutouts, config.split, progress=progress)
    with fraction_callback("recordings") as progress:
        write_dataset(config.out, pictures, config.sequence, config.num, config.seed, config.flow, progress)
    console.print(f"{config.num} recordings in {config.out}")
    return 0


def _run_video(config: Simulate, video: Path) -> int:
    if config.photos is not None:
        raise EtnetError("--photos and --video do not go together; give one of them")
    seen = VideoConfig(config.contrast, config.noise, config.side, config.speed, config.seed)
    config.out.resolve().parent.mkdir(parents=True, exist_ok=True)
    with fraction_callback(f"watching {video.name}") as progress:
        num_events = simulate_video(video, config.out, seen, progress)
    text = f"wrote {config.out}: {num_events:,} events; look at it with etnet-view {config.out}"
    console.print(text, markup=False, soft_wrap=True)
    return 0
