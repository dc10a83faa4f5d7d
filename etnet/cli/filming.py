"""The options of `etnet simulate OUT --video …`: what is seen, by which sensor. What a source cannot do is refused."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Literal

import tyro

from etnet.errors import EtnetError
from etnet.events.write import Layout
from etnet.simulation.camera_path import PhotoInMotion
from etnet.simulation.decode import VideoFootage
from etnet.simulation.footage import Footage, Framing
from etnet.simulation.picture_file import SUFFIXES
from etnet.simulation.picture_folder import PictureFolder
from etnet.simulation.settings import PixelSettings, camera_named
from etnet.simulation.tone import Tone
from etnet.simulation.video import GAMMA, VideoConfig
from etnet.simulation.walk import Interpolate, Stepping

Kind = Literal["video", "pictures", "photo"]
_WORDS: dict[Kind, str] = {"video": "a video", "pictures": "pictures", "photo": "a photo in motion"}
_SIDE, _CONTRAST, _NOISE, _REACH = 320, 0.2, 0.2, 10.0
SECONDS = 0.3
"""Length of a photo's motion, where none is said."""


@dataclass(frozen=True)
class Filming:
    """What a sensor sees of a video, of pictures or of a photo; with --video only."""

    video: tuple[Path, ...] = ()
    """A video, a folder of pictures, a pattern like "render/*.png", or with --motion one photo. Several, or a folder of
    videos: OUT is then a folder, and the work is shared out (docs/many.md)."""
    contrast: float = _CONTRAST
    """Change of natural-log intensity that makes an event."""
    noise: float = _NOISE
    """0 is an ideal sensor, 1 a mediocre one."""
    side: int = _SIDE
    """Pixels of the longer side, at most."""
    speed: float = 1.0
    """How much faster the scene runs before the sensor; of ×8 slow motion say 8."""
    camera: str | None = None
    """A camera's size and published figures: DAVIS240C, DAVIS346, DVXplorer, DVXplorer-Lite, EVK3-HD, EVK4."""
    like: Path | None = None
    """A recording of your own camera: its sensor is measured, and the simulated one follows it."""
    pos_thres: float | None = None
    """Threshold of ON events, in natural-log intensity. Of this and what follows, what is
    not given is as --contrast and --noise, --camera or --like have it."""
    neg_thres: float | None = None
    sigma_thres: float | None = None
    cutoff_hz: float | None = None
    """Bandwidth of a white pixel; darker ones are slower. 0: no limit."""
    leak_rate_hz: float | None = None
    shot_noise_rate_hz: float | None = None
    refractory_us: float | None = None
    lag_us: float | None = None
    """How much later than the frames the events come."""
    hot_share: float | None = None
    """Share of pixels that fire by themselves."""
    hot_hz: float | None = None
    """Their events each second, at most."""
    dark: float | None = None
    """Dark current: the sensor sees log(intensity + dark), intensity 1 being white."""
    interpolate: str = "auto"
    """Steps between two frames: auto, off (straight lines), or a number."""
    interpolator: Path | None = None
    """A learned interpolator as ONNX, in RIFE's layout; without it optical flow is used."""
    gamma: float | None = None
    """Tone of a video that states none, 2.2 by default; of pictures and photos, sRGB by default."""
    stamps: Path | None = None
    """Of pictures: a table of their times. A table in the folder is found; --fps replaces it."""
    motion: str | None = None
    """Of a photo: saccades, drift, or a CSV of seconds, x, y[, degrees[, zoom]]."""
    reach: float | None = None
    """Pixels that saccades and drift go to either side, 10 by default."""
    begin: Annotated[float, tyro.conf.arg(name="from")] = 0.0
    """Seconds of the video, or of the motion, to begin at."""
    end: Annotated[float | None, tyro.conf.arg(name="to")] = None
    """Seconds of it to end at. Default: its end."""
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
    """Replace OUT if it is there. Of several videos those that are finished are left as they are; with it they are done
    again."""

    def framing(self, size: tuple[int, int] | None) -> Framing:
        """Which part of the pictures falls on a sensor of this size (that of --size)."""
        if self.side != _SIDE and (size or self.camera):
            raise EtnetError(
                f"--side and {'--size' if size else '--camera'} both say how large it is; give one of them"
            )
        size = size or (camera_named(self.camera).size if self.camera else None)
        return Framing(self.side, size, self.region, self.rotate, self.begin, self.end, self.speed)

    def attributes(self, fps: float | None, seconds: float | None) -> dict[str, str | int | float]:
        """What else was asked for, as a file keeps it."""
        moves = {"motion": self.motion, "reach": self.reach or _REACH, "seconds": seconds or SECONDS}
        named = {
            "camera": self.camera,
            "like": None if self.like is None else self.like.name,
            "fps": fps,
            "stamps": None if self.stamps is None else self.stamps.name,
            "interpolator": None if self.interpolator is None else self.interpolator.name,
            **(moves if self.motion else {}),
        }
        return {name: value for name, value in named.items() if value is not None}

    def config(self, seed: int, size: tuple[int, int] | None, twin: PixelSettings | None = None) -> VideoConfig:
        """The settings of the simulation; `twin` is what was measured of a recording."""
        if self.interpolator is not None and self.interpolate == "off":
            raise EtnetError(
                "--interpolate off takes no steps, so --interpolator has none to make; leave one of them out"
            )
        config = VideoConfig(
            contrast=self.contrast,
            noise=self.noise,
            seed=seed,
            framing=self.framing(size),
            stepping=Stepping(_interpolate(self.interpolate), learned=_learned(self.interpolator)),
            gamma=GAMMA if self.gamma is None else self.gamma,
            drops_repeats=self.drop_repeats,
            has_colour=self.colour,
            has_flow=self.store_flow,
            exposure_us=self.exposure_ms * 1000,
            frame_noise=self.frame_noise,
        )
        asked = {one.name: getattr(self, one.name) for one in fields(PixelSettings)}
        given = {name: value for name, value in asked.items() if value is not None}
        base = twin or (camera_named(self.camera).pixels if self.camera else None)
        if (self.camera or self.like) and (self.contrast, self.noise) != (_CONTRAST, _NOISE):
            named = "--like" if self.like else "--camera"
            raise EtnetError(
                f"{named} says what the sensor is, so --contrast and --noise have no part in it; give --pos-thres, "
                "--neg-thres or another of its parameters"
            )
        if base is None and given:
            base = config.as_pixels
        return config if base is None else replace(config, pixels=replace(base, **given))


def given_options(filming: Filming) -> list[str]:
    """The names of what differs from its default."""
    names = {"begin": "from", "end": "to"}
    plain = Filming()
    changed = [one.name for one in fields(Filming) if getattr(filming, one.name) != getattr(plain, one.name)]
    return [f"--{names.get(name, name).replace('_', '-')}" for name in changed]


def kind_of(filming: Filming, source: Path) -> Kind:
    """What the source is, by its place and what was said of it."""
    if filming.motion is not None:
        return "photo"
    if source.is_dir() or any(sign in source.name for sign in "*?["):
        return "pictures"
    if source.suffix.lower() in SUFFIXES:
        raise EtnetError(
            f"{source.name}: one picture does not move; give --motion saccades, drift or a CSV of the path"
        )
    return "video"


def footage(filming: Filming, source: Path, config: VideoConfig, fps: float | None, seconds: float | None) -> Footage:
    """The frames of one source, as the options want them seen. Raises EtnetError for those that it cannot follow."""
    kind = kind_of(filming, source)
    _refuse_foreign(filming, source, kind, fps, seconds)
    tone = None if filming.gamma is None else Tone("gamma", config.gamma)
    if kind == "photo":
        named = filming.motion if filming.motion in ("saccades", "drift") else None
        motion = Path(filming.motion or "") if named is None else named
        length = seconds or SECONDS, filming.reach or _REACH
        return PhotoInMotion(source, motion, config.seen, *length, config.seed, tone, config.has_colour)  # pyright: ignore
    if kind == "pictures":
        stamps = fps, filming.stamps
        return PictureFolder(source, config.seen, *stamps, tone, config.drops_repeats, config.has_colour)
    return VideoFootage(source, config.seen, config.gamma, config.drops_repeats, config.has_colour)


def _refuse_foreign(filming: Filming, source: Path, kind: Kind, fps: float | None, seconds: float | None) -> None:
    filmed: tuple[Kind, ...] = ("video", "pictures")
    options: tuple[tuple[str, bool, tuple[Kind, ...]], ...] = (
        ("--fps", fps is not None, ("pictures",)),
        ("--stamps", filming.stamps is not None, ("pictures",)),
        ("--seconds", seconds is not None, ("photo",)),
        ("--reach", filming.reach is not None, ("photo",)),
        ("--drop-repeats", filming.drop_repeats, filmed),
        ("--store-flow", filming.store_flow, filmed),
        ("--interpolate", filming.interpolate != "auto", filmed),
        ("--interpolator", filming.interpolator is not None, filmed),
    )
    for name, is_given, kinds in options:
        if is_given and kind not in kinds:
            known = " or ".join(_WORDS[one] for one in kinds)
            raise EtnetError(f"{source.name}: is {_WORDS[kind]}, and {name} is for {known}; leave it out")
    if filming.motion not in (None, "saccades", "drift") and (seconds is not None or filming.reach is not None):
        named = "--seconds" if seconds is not None else "--reach"
        raise EtnetError(f"{filming.motion}: says itself how long and how far the motion goes; leave {named} out")


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
