"""Any footage seen by a modelled event sensor, one frame after the other: any length fits."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import h5py
import numpy as np
from jaxtyping import Float32, Shaped

from etnet.errors import Cancelled, RecordingError
from etnet.events.formats.hdf5.writing import hdf5_to_write
from etnet.files import check_target, printable, replacing
from etnet.simulation.beginning import Beginning
from etnet.simulation.decode import VideoFootage
from etnet.simulation.footage import Footage, Frame, Framing
from etnet.simulation.sensor import SensorTraits
from etnet.simulation.settings import PixelSettings
from etnet.simulation.sink import RecordingSink
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.tone import stored_picture
from etnet.simulation.walk import Stepping

_NOISY = SensorTraits(0.0, 0.0, mismatch=0.05, leak_hz=0.2, shot_hz=2.0, hot_share=0.0005, hot_hz=30.0)
"""What `noise` = 1 adds: a mediocre real sensor in ordinary light."""

GAMMA = 2.2
"""Tone of a video that states none."""


@dataclass(frozen=True, slots=True)
class VideoConfig:
    """How a video is seen. `contrast` is the change of natural-log intensity that makes an event (0.1 … 0.5 in chips).

    `noise` 0 is an ideal sensor, 1 a mediocre one; `pixels` says all of the sensor and replaces both. Pictures are
    brought to `longest_side` pixels at most. `speed` plays the scene faster (2) or slower (0.1) before the sensor: of a
    slow-motion video say how slow. `framing` says all of what is seen, and replaces these two.
    """

    contrast: float = 0.2
    noise: float = 0.2
    longest_side: int = 320
    speed: float = 1.0
    seed: int = 0
    pixels: PixelSettings | None = None
    framing: Framing | None = None
    stepping: Stepping = Stepping()  # noqa: RUF009  (frozen)
    cutoff_hz: float = 0.0
    """Bandwidth of a white pixel; 0 is no limit. `pixels` replaces it, too."""
    gamma: float = GAMMA
    """Tone of a video that states none."""
    drops_repeats: bool = False
    has_colour: bool = False
    """Store the frames in colour."""
    has_flow: bool = False
    """Store the optical flow between frames."""
    exposure_us: float = 0.0
    """Store frames as an ordinary camera with this exposure sees them: blurred by motion. 0: as they come."""
    frame_noise: float = 0.0
    """Noise of such frames, standard deviation as a share of white."""

    def __post_init__(self) -> None:
        if not 0.02 <= self.contrast <= 2:
            raise RecordingError(f"contrast is {self.contrast:g}; it takes 0.02 (many events) to 2 (few)")
        if not 0 <= self.noise <= 5:
            raise RecordingError(f"noise is {self.noise:g}; it takes 0 (an ideal sensor) to 5")
        if not 0 <= self.cutoff_hz < 1e7:
            raise RecordingError(f"cutoff is {self.cutoff_hz:g} Hz; it takes 0 (no limit) or more")
        if not 0.3 <= self.gamma <= 5:
            raise RecordingError(f"gamma is {self.gamma:g}; it takes 0.3 to 5")
        if not 0 <= self.exposure_us <= 1e6 or not 0 <= self.frame_noise <= 1:
            raise RecordingError(
                f"exposure is {self.exposure_us:g} µs, noise of the frames {self.frame_noise:g}; wanted 0 to 1 s, and "
                "a share of white"
            )
        if self.has_colour and (self.exposure_us or self.frame_noise):
            raise RecordingError("frames in colour are stored as they come, without exposure or noise; leave one out")
        _ = self.seen

    @property
    def seen(self) -> Framing:
        """Which part of the pictures falls on the sensor."""
        return self.framing or Framing(longest_side=self.longest_side, speed=self.speed)

    @property
    def traits(self) -> SensorTraits:
        """The sensor's pixels."""
        if self.pixels is not None:
            return self.pixels.traits
        return SensorTraits(
            threshold_on=self.contrast,
            threshold_off=self.contrast,
            mismatch=_NOISY.mismatch * min(self.noise, 4.0),
            leak_hz=_NOISY.leak_hz * self.noise,
            shot_hz=_NOISY.shot_hz * self.noise,
            hot_share=_NOISY.hot_share * self.noise,
            hot_hz=_NOISY.hot_hz,
            cutoff_hz=self.cutoff_hz,
        )

    @property
    def as_pixels(self) -> PixelSettings:
        """The sensor under v2e's names."""
        if self.pixels is not None:
            return self.pixels
        traits = self.traits
        return PixelSettings(
            pos_thres=traits.threshold_on,
            neg_thres=traits.threshold_off,
            sigma_thres=traits.mismatch * self.contrast,
            cutoff_hz=traits.cutoff_hz,
            leak_rate_hz=traits.leak_hz,
            shot_noise_rate_hz=traits.shot_hz,
            hot_share=traits.hot_share,
            hot_hz=traits.hot_hz,
        )

    @property
    def as_attributes(self) -> dict[str, str | int | float]:
        """How it was made, under names that a file keeps."""
        pixels = self.as_pixels
        seen = self.seen
        framed = {
            "side": seen.longest_side if seen.size is None else 0,
            "size": "" if seen.size is None else f"{seen.size[0]} {seen.size[1]}",
            "crop": "" if seen.crop is None else " ".join(map(str, seen.crop)),
            "rotate": seen.rotate,
            "start": seen.start,
            "stop": seen.stop or 0.0,
            "drops_repeats": self.drops_repeats,
        }
        return {
            **{name: value for name, value in framed.items() if value},
            "gamma": self.gamma,
            **pixels.as_attributes,
            "contrast": self.contrast if self.pixels is None else (pixels.pos_thres * pixels.neg_thres) ** 0.5,
            "noise": self.noise if self.pixels is None else -1.0,
            "seed": self.seed,
            "interpolate": str(self.stepping.interpolate) if self.stepping.learned is None else "learned",
            "speed": seen.speed,
            "exposure_us": self.exposure_us,
            "frame_noise": self.frame_noise,
        }


def footage_of(video: Path, config: VideoConfig) -> VideoFootage:
    """The video, as `config` wants it seen."""
    return VideoFootage(video, config.seen, config.gamma, config.drops_repeats, config.has_colour)


def simulate_video(
    video: Path,
    out: Path,
    config: VideoConfig,
    progress: Callable[[float], None] | None = None,
    is_cancelled: Callable[[], bool] | None = None,
) -> int:
    """Write what the sensor sees of `video` to `out` (event_utils HDF5, with the frames); returns the events.

    A few frames and their events are in memory at a time. `out` appears whole or not at all.
    """
    check_target(out)
    with closing(footage_of(video, config)) as footage:
        return simulate_footage(footage, out, config, progress, is_cancelled).num_events


class Written(NamedTuple):
    """What a simulation gave, and what should be said of it."""

    num_events: int
    num_frames: int
    remarks: tuple[str, ...]


def simulate_footage(
    footage: Footage,
    out: Path,
    config: VideoConfig,
    progress: Callable[[float], None] | None = None,
    is_cancelled: Callable[[], bool] | None = None,
    attributes: Mapping[str, str | int | float] | None = None,
) -> Written:
    """Write what the sensor sees of any footage, as `simulate_video` does of a video."""
    shown = Shown(-1, 0, 0, 0)
    with replacing(out) as part, hdf5_to_write(part, libver=("v110", "v110")) as file:
        for shown in simulated(file, footage, config, attributes):
            if is_cancelled is not None and is_cancelled():
                raise Cancelled("the simulation was stopped")
            file.check()
            if progress is not None:
                progress(min(shown.stamp / 1e6 / max(footage.duration, 1e-6), 1.0))
        num_events = int(file.attrs["num_events"])  # pyright: ignore[reportArgumentType]  the lag's last ones too
    return Written(num_events, shown.frame + 1, tuple(footage.remarks))


class Shown(NamedTuple):
    """What is in the file after one more frame (counted from 0): its stamp as the file has it (µs), all events."""

    frame: int
    stamp: int
    num_events: int
    last_event: int
    """Stamp of the last event, µs; 0 before any."""


def simulated(
    file: h5py.File,
    footage: Footage,
    config: VideoConfig,
    attributes: Mapping[str, str | int | float] | None = None,
    beginning: Beginning | None = None,
) -> Iterator[Shown]:
    """Show frame after frame to the sensor and write it with its events. `beginning` is that of this footage."""
    sink, before = RecordingSink(file, footage.sensor), 0.0
    camera_rng = np.random.default_rng([config.seed, 1])
    stepping = Stepping("off") if footage.is_fine else config.stepping
    frames = footage if beginning is None else beginning.frames(footage)
    with EventSimulator(
        config.traits, stepping, config.seed, exposure_us=config.exposure_us, beginning=beginning
    ) as simulator:
        for index, (frame, events) in enumerate(simulator.run(frames)):
            sink.append(events)
            if frame.is_stored:
                sink.add_frame(frame.t, _stored(frame, footage, config, simulator.camera, camera_rng))
            if config.has_flow and frame.is_stored and index and simulator.flow is not None:
                sink.add_flow(frame.t, simulator.flow, (frame.t - before) / 1e6)
            before = frame.t
            yield Shown(index, int(np.floor(frame.t)), sink.num_events, sink.last)
        sink.append(simulator.finish())
        if config.has_flow and not sink.num_flows:
            footage.remarks.append("no motion was looked for, so that there is no flow to store")
        traits = config.traits
        footage.remarks += simulator.account.sentences(min(traits.threshold_on, traits.threshold_off))
    known = {**config.as_attributes, "tone": str(footage.tone), **(attributes or {})}
    sink.finish(
        {
            **known,
            "source": f"simulated from {printable(footage.name)}",
            "simulation": json.dumps(known),
            "remarks": "; ".join(footage.remarks),
        }
    )


def _stored(
    frame: Frame,
    footage: Footage,
    config: VideoConfig,
    camera: Float32[np.ndarray, "h w"] | None,
    rng: np.random.Generator,
) -> Shaped[np.ndarray, "h w *c"]:
    if config.has_colour and frame.colour is not None:
        return frame.colour
    light = camera if config.exposure_us > 0 and camera is not None else frame.light
    if config.frame_noise > 0:
        light = light + np.float32(config.frame_noise) * rng.standard_normal(light.shape, np.float32)
    return stored_picture(light, footage.tone, footage.bits)


def resized(config: VideoConfig, longest_side: int) -> VideoConfig:
    """The same at another size."""
    return replace(config, framing=replace(config.seen, longest_side=longest_side))
