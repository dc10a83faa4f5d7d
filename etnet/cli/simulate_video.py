"""`etnet simulate OUT --video …`: what a modelled sensor, or a twin of your own, sees of footage."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal

import tyro
from rich.table import Table

from etnet.cli.progress import console, fraction_callback
from etnet.errors import EtnetError
from etnet.events.open import open_recording
from etnet.events.write import WITHOUT_PROVENANCE, Layout, check_place, layout_of, write_recording
from etnet.files import write_atomically
from etnet.simulation.camera_path import PhotoInMotion
from etnet.simulation.decode import VideoFootage
from etnet.simulation.footage import Footage, Framing
from etnet.simulation.like import Twin, beside, measure_twin
from etnet.simulation.picture_folder import PictureFolder
from etnet.simulation.settings import PixelSettings, camera_named
from etnet.simulation.video import VideoConfig, Written, simulate_footage
from etnet.simulation.walk import Interpolate, Stepping


@dataclass(frozen=True)
class Filming:
    """What a sensor sees of a video, of pictures or of a photo; with --video only."""

    video: Path | None = None
    """A video, a folder of pictures, a pattern like "render/*.png", or with --motion one photo."""
    contrast: float = 0.2
    """Change of natural-log intensity that makes an event."""
    noise: float = 0.2
    """0 is an ideal sensor, 1 a mediocre one."""
    side: int = 320
    """Pixels of the longer side, at most."""
    speed: float = 1.0
    """How much faster the scene runs before the sensor; of ×8 slow motion say 8."""
    camera: str | None = None
    """A camera's size and published figures: DAVIS240C, DAVIS346, DVXplorer, DVXplorer-Lite, EVK3-HD, EVK4."""
    like: Path | None = None
    """A recording of your own camera: its sensor is measured, and the simulated one follows it."""
    pos_thres: float | None = None
    """Threshold of ON events, in natural-log intensity. This and what follows replace --contrast and --noise."""
    neg_thres: float | None = None
    sigma_thres: float | None = None
    cutoff_hz: float | None = None
    """Bandwidth of a white pixel; darker ones are slower. 0: no limit."""
    leak_rate_hz: float | None = None
    shot_noise_rate_hz: float | None = None
    refractory_us: float | None = None
    lag_us: float | None = None
    """How much later than the frames the events come."""
    interpolate: str = "auto"
    """Steps between two frames: auto, off (straight lines), or a number."""
    interpolator: Path | None = None
    """A learned interpolator as ONNX, in RIFE's layout; without it optical flow is used."""
    gamma: float = 2.2
    """Tone of a video that states none."""
    stamps: Path | None = None
    """Of pictures: a table of their times. A table in the folder is found; --fps replaces it."""
    motion: str | None = None
    """Of a photo: saccades, drift, or a CSV of seconds, x, y[, degrees[, zoom]]."""
    reach: float = 10.0
    """Pixels that saccades and drift go to either side."""
    begin: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """Seconds of the video to begin at."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds of the video to end at. Default: its end."""
    region: tuple[int, int, int, int] | None = None
    """x y width height, pixels of the upright picture."""
    rotate: Literal[0, 90, 180, 270] = 0
    """Degrees clockwise."""
    drop_repeats: bool = False
    """Leave out frames that repeat the one before."""
    colour: bool = False
    """Store the frames in colour."""
    store_flow: bool = False
    """Store the optical flow between frames."""
    exposure_ms: float = 0.0
    """Store frames as a camera with this exposure sees them, blurred by motion."""
    frame_noise: float = 0.0
    """Noise of the stored frames, as a share of white."""
    layout: Layout | None = None
    """The format, where the suffix of OUT does not say it."""
    overwrite: bool = False
    """Replace OUT if it is there."""

    def framing(self) -> Framing:
        """Which part of the pictures falls on the sensor."""
        size = camera_named(self.camera).size if self.camera else None
        return Framing(self.side, size, self.region, self.rotate, self.begin, self.end, self.speed)

    def attributes(self, fps: float | None, seconds: float) -> dict[str, str | int | float]:
        """What else was asked for, as a file keeps it."""
        moves = {"motion": self.motion, "reach": self.reach, "seconds": seconds} if self.motion else {}
        named = {
            "camera": self.camera,
            "like": None if self.like is None else self.like.name,
            "fps": fps,
            "stamps": None if self.stamps is None else self.stamps.name,
            "interpolator": None if self.interpolator is None else self.interpolator.name,
            **moves,
        }
        return {name: value for name, value in named.items() if value is not None}

    def config(self, seed: int, twin: PixelSettings | None) -> VideoConfig:
        """The settings of the simulation; `twin` is what was measured of a recording."""
        exposure = self.exposure_ms * 1000
        stepping = Stepping(_interpolate(self.interpolate), learned=_learned(self.interpolator))
        config = VideoConfig(
            contrast=self.contrast,
            noise=self.noise,
            seed=seed,
            framing=self.framing(),
            stepping=stepping,
            gamma=self.gamma,
            drops_repeats=self.drop_repeats,
            has_colour=self.colour,
            has_flow=self.store_flow,
            exposure_us=exposure,
            frame_noise=self.frame_noise,
        )
        asked = {one.name: getattr(self, one.name, None) for one in fields(PixelSettings)}
        given = {name: value for name, value in asked.items() if value is not None}
        base = twin or (camera_named(self.camera).pixels if self.camera else None)
        if base is None and given:
            base = config.as_pixels
        return config if base is None else replace(config, pixels=replace(base, **given))


def run_video(filming: Filming, out: Path, seed: int, fps: float | None, seconds: float) -> int:
    """Do it; returns the exit code."""
    # What cannot be written is refused before the work, not after it.
    layout = layout_of(out, filming.layout)
    config = filming.config(seed, None)
    check_place(out, layout, filming.overwrite)
    twin = None if filming.like is None else _measured(filming.like)
    config = config if twin is None else filming.config(seed, twin.pixels)
    out.resolve().parent.mkdir(parents=True, exist_ok=True)
    attributes = filming.attributes(fps, seconds)
    with closing(_footage(filming, config, fps, seconds)) as footage:
        written = _write(filming, footage, out, config, attributes)
    for remark in written.remarks:
        console.print(f"  {remark}", markup=False, soft_wrap=True, style="dim")
    seen = f"{written.num_events:,} events, {written.num_frames:,} frames"
    console.print(f"wrote {out}: {seen}; look at it with etnet-view {out}", markup=False, soft_wrap=True)
    return 0


def _footage(filming: Filming, config: VideoConfig, fps: float | None, seconds: float) -> Footage:
    source = filming.video
    assert source is not None
    if filming.motion is not None:
        motion = filming.motion if filming.motion in ("saccades", "drift") else Path(filming.motion)
        return PhotoInMotion(source, motion, config.seen, seconds, filming.reach, config.seed)  # pyright: ignore
    if source.is_dir() or any(sign in source.name for sign in "*?["):
        return PictureFolder(source, config.seen, fps, filming.stamps)
    if source.suffix.lower() in (".png", ".jpg", ".jpeg", ".webp", ".bmp"):
        raise EtnetError(
            f"{source.name}: one picture does not move; give --motion saccades, drift or a CSV of the path"
        )
    return VideoFootage(source, config.seen, config.gamma, config.drops_repeats, config.has_colour)


def _write(
    filming: Filming, footage: Footage, out: Path, config: VideoConfig, attributes: Mapping[str, str | int | float]
) -> Written:
    layout = layout_of(out, filming.layout)
    with fraction_callback(f"watching {footage.name}") as progress:
        if layout == "event_utils":
            return simulate_footage(footage, out, config, progress, attributes=attributes)
        with TemporaryDirectory(prefix="etnet-simulate-", dir=out.resolve().parent) as folder:
            made = Path(folder) / f"{out.stem}.h5"
            written = simulate_footage(footage, made, config, progress, attributes=attributes)
            if written.num_events == 0:
                raise EtnetError(f"{footage.name}: {written.remarks[-1]}")
            with open_recording(made) as recording, fraction_callback(f"writing {out.name}") as told:
                said = write_recording(recording, out, layout, overwrite=True, progress=told)
    kept = () if layout not in WITHOUT_PROVENANCE else (_keep_beside(footage, out, config, attributes),)
    return written._replace(remarks=(*written.remarks, *(remark.text for remark in said), *kept))


def _keep_beside(footage: Footage, out: Path, config: VideoConfig, attributes: Mapping[str, str | int | float]) -> str:
    """The parameters in a file beside one that has no place for them."""
    parameters = out.with_name(out.name + ".json")
    known = {"source": footage.name, **config.as_attributes, **attributes, "remarks": footage.remarks}
    write_atomically(parameters, (json.dumps(known, indent=1) + "\n").encode())
    return f"the parameters stand in {parameters.name}"


def _measured(path: Path) -> Twin:
    with open_recording(path) as recording, fraction_callback(f"measuring {path.name}") as progress:
        twin = measure_twin(recording, progress=progress)
    settings = ", ".join(f"{name} {value:g}" for name, value in twin.pixels.as_attributes.items() if value)
    console.print(f"the sensor of {path.name}: {settings}", markup=False, soft_wrap=True)
    for remark in twin.remarks:
        console.print(f"  {remark}", markup=False, soft_wrap=True, style="dim")
    if twin.correlation is not None:
        title = f"voxels correlate by {twin.correlation:.2f} on its own frames"
        table = Table(title=title, title_justify="left", box=None)
        for heading in ("", "recorded", "simulated"):
            table.add_column(heading, justify="left" if not heading else "right")
        for row in beside(twin):
            table.add_row(*row)
        console.print(table)
    return twin


def _interpolate(text: str) -> Interpolate:
    if text in ("auto", "off"):
        return text
    if not text.isdigit():
        raise EtnetError(f"--interpolate is {text!r}; it takes auto, off, or a number of steps")
    return int(text)


def _learned(path: Path | None):
    if path is None:
        return None
    from etnet.simulation.learned import LearnedInterpolator

    return LearnedInterpolator(path)
