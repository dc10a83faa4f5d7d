"""Any video seen by a modelled event sensor (ESIM, Rebecq et al. 2018), one frame after the other: any length fits.

Between two frames each pixel's log intensity runs straight. What moves more than a pixel or two from frame to frame
therefore flashes rather than moves: film slowly, or with many frames a second.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import cv2
import h5py
import numpy as np
from jaxtyping import Float32, UInt8

from etnet.errors import Cancelled, RecordingError
from etnet.events.events import Events, Sensor
from etnet.files import check_target
from etnet.simulation.sensor import PixelArray, SensorTraits, draw_noise, events_of

CHUNK = 65_536
"""Events stored together."""
_GAMMA = 2.2
"""Of a video's grey values; the sensor sees light."""
_NOISY = SensorTraits(0.0, 0.0, mismatch=0.05, leak_hz=0.2, shot_hz=2.0, hot_share=0.0005, hot_hz=30.0)
"""What `noise` = 1 adds: a mediocre real sensor in ordinary light."""


@dataclass(frozen=True, slots=True)
class VideoConfig:
    """How a video is seen. `contrast` is the change of natural-log intensity that makes an event (0.1 … 0.5 in chips).

    `noise` 0 is an ideal sensor, 1 a mediocre one. Pictures are brought to `longest_side` pixels at most. `speed` plays
    the scene faster (2) or slower (0.1) before the sensor: of a slow-motion video say how slow.
    """

    contrast: float = 0.2
    noise: float = 0.2
    longest_side: int = 320
    speed: float = 1.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.02 <= self.contrast <= 2:
            raise RecordingError(f"contrast is {self.contrast:g}; it takes 0.02 (many events) to 2 (few)")
        if not 0 <= self.noise <= 5:
            raise RecordingError(f"noise is {self.noise:g}; it takes 0 (an ideal sensor) to 5")
        if not 16 <= self.longest_side <= 1280:
            raise RecordingError(f"the longest side is {self.longest_side}; it takes 16 to 1280 pixels")
        if not 0.001 <= self.speed <= 1000:
            raise RecordingError(f"speed is {self.speed:g}; it takes 0.001 to 1000")

    @property
    def traits(self) -> SensorTraits:
        """The sensor's pixels."""
        return SensorTraits(
            threshold_on=self.contrast,
            threshold_off=self.contrast,
            mismatch=_NOISY.mismatch * min(self.noise, 4.0),
            leak_hz=_NOISY.leak_hz * self.noise,
            shot_hz=_NOISY.shot_hz * self.noise,
            hot_share=_NOISY.hot_share * self.noise,
            hot_hz=_NOISY.hot_hz,
        )


def simulate_video(
    video: Path,
    out: Path,
    config: VideoConfig,
    progress: Callable[[float], None] | None = None,
    is_cancelled: Callable[[], bool] | None = None,
) -> int:
    """Write what the sensor sees of `video` to `out` (event_utils HDF5, with the frames); returns the events.

    One frame and its events are in memory at a time. `out` appears whole or not at all.
    """
    check_target(out)
    part = out.with_name(out.name + ".part")
    try:
        num_events = 0
        with closing(VideoFrames(video, config)) as frames, h5py.File(part, "w", libver=("v110", "v110")) as file:
            for shown in simulated(file, frames, config):
                num_events = shown.num_events
                if is_cancelled is not None and is_cancelled():
                    raise Cancelled("the simulation was stopped")
                if progress is not None:
                    progress(min((shown.frame + 1) / frames.num_frames, 1.0))
            file.attrs["source"] = f"simulated from {video.name}"
            file.attrs["contrast"], file.attrs["noise"], file.attrs["seed"] = config.contrast, config.noise, config.seed
        os.replace(part, out)
    finally:
        part.unlink(missing_ok=True)
    return num_events


class VideoFrames:
    """A video's frames as light (linear, 0 … 1) with their stamps in µs."""

    def __init__(self, path: Path, config: VideoConfig) -> None:
        if not path.is_file():
            raise RecordingError(f"{path.name}: there is no such video")
        self._path = path
        self._capture = cv2.VideoCapture(str(path))
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        if not self._capture.isOpened():
            raise RecordingError(f"{path.name}: cannot be read as a video; MP4 (H.264) always works")
        if not 0.1 <= rate <= 100_000:
            raise RecordingError(f"{path.name}: says it has {rate:g} frames a second; convert it to MP4 first")
        self.interval = 1e6 / rate / config.speed
        self.num_frames = max(int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT)), 1)
        width = int(self._capture.get(cv2.CAP_PROP_FRAME_WIDTH))
        height = int(self._capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
        if min(width, height) < 8:
            raise RecordingError(f"{path.name}: its pictures are {width}×{height}; wanted at least 8 pixels a side")
        scale = min(1.0, config.longest_side / max(width, height))
        self.sensor = Sensor(max(8, round(width * scale)), max(8, round(height * scale)))

    def __iter__(self) -> Iterator[tuple[float, UInt8[np.ndarray, "h w"]]]:
        index = 0
        while True:
            is_there, picture = self._capture.read()
            if not is_there:
                break
            grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
            if grey.shape != (self.sensor.height, self.sensor.width):
                grey = cv2.resize(grey, (self.sensor.width, self.sensor.height), interpolation=cv2.INTER_AREA)
            yield index * self.interval, grey
            index += 1
        if index < 2:
            raise RecordingError(f"{self._path.name}: holds {index} frames that can be read; events need two")

    def close(self) -> None:
        """Let go of the file."""
        self._capture.release()


def _light(grey: UInt8[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
    return (grey.astype(np.float32) / 255) ** np.float32(_GAMMA)


class Shown(NamedTuple):
    """What is in the file after one more frame (counted from 0): its stamp as the file has it (µs), all events."""

    frame: int
    stamp: int
    num_events: int
    last_event: int
    """Stamp of the last event, µs; 0 before any."""


def simulated(file: h5py.File, frames: VideoFrames, config: VideoConfig) -> Iterator[Shown]:
    """Show frame after frame to the sensor and write it with its events; one of them is in memory at a time."""
    rng, traits, sink = np.random.default_rng(config.seed), config.traits, _EventSink(file, frames.sensor)
    pixels: PixelArray | None = None
    before, index = 0.0, 0
    for index, (t, grey) in enumerate(frames):
        light = _light(grey)
        if pixels is None:
            pixels = PixelArray(light, t, traits, rng)
        else:
            noise = draw_noise(light, (before, t), traits, rng)
            sink.append(events_of([pixels.expose(light, t), noise], frames.sensor))
        _write_frame(file, index, t, grey, sink.num_events)
        before = t
        yield Shown(index, int(np.floor(t)), sink.num_events, sink.last)
    sink.finish(index + 1)


def _write_frame(file: h5py.File, index: int, t: float, grey: UInt8[np.ndarray, "h w"], num_events: int) -> None:
    image = file.create_dataset(
        f"images/image{index:09d}", data=grey, chunks=grey.shape, compression="gzip", compression_opts=4, shuffle=True
    )
    image.attrs["size"] = grey.shape
    image.attrs["timestamp"] = np.floor(t) * 1e-6
    image.attrs["type"] = "greyscale"
    image.attrs["event_idx"] = max(num_events - 1, 0)


class _EventSink:
    """Columns that grow on disk. Stamps never run back: what came after a frame's stamp is stamped with or after it."""

    def __init__(self, file: h5py.File, sensor: Sensor) -> None:
        self.num_events = 0
        self._file, self._sensor = file, sensor
        self._num_positive = 0
        self._first, self.last = 0, 0
        for name, kind in (("xs", np.int16), ("ys", np.int16), ("ts", np.float64), ("ps", np.bool_)):
            file.create_dataset(
                f"events/{name}", (0,), kind, maxshape=(None,), chunks=(CHUNK,), compression="gzip", shuffle=True
            )

    def append(self, events: Events) -> None:
        """Add the events of one frame, in order."""
        if len(events) == 0:
            return
        start, stop = self.num_events, self.num_events + len(events)
        for name, column in (
            ("xs", events.x.astype(np.int16)),
            ("ys", events.y.astype(np.int16)),
            ("ts", events.t * 1e-6),
            ("ps", events.p > 0),
        ):
            held = self._file[f"events/{name}"]
            held.resize((stop,))  # pyright: ignore[reportAttributeAccessIssue]
            held[start:stop] = column  # pyright: ignore[reportIndexIssue]
        self._first = int(events.t[0]) if start == 0 else self._first
        self.last, self.num_events = int(events.t[-1]), stop
        self._num_positive += int((events.p > 0).sum())

    def finish(self, num_frames: int) -> None:
        """Write what readers of this layout look for first."""
        attributes = self._file.attrs
        attributes["num_events"] = self.num_events
        attributes["num_pos"], attributes["num_neg"] = self._num_positive, self.num_events - self._num_positive
        attributes["t0"], attributes["tk"] = self._first * 1e-6, self.last * 1e-6
        attributes["duration"] = (self.last - self._first) * 1e-6
        attributes["sensor_resolution"] = (self._sensor.height, self._sensor.width)
        attributes["num_imgs"], attributes["num_flow"] = num_frames, 0
