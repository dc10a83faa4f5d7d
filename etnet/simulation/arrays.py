"""Frames from Python, whatever makes them: a list, an array, a generator, a renderer, a webcam."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from jaxtyping import Float32, Shaped

from etnet.errors import RecordingError
from etnet.events.events import Events
from etnet.simulation.footage import Frame
from etnet.simulation.settings import Camera, PixelSettings, camera_named
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.tone import Tone
from etnet.simulation.walk import Stepping

SRGB = Tone("srgb")


def simulate(
    frames: Iterable[Shaped[np.ndarray, "h w *c"]],
    stamps: Iterable[float],
    sensor: PixelSettings | Camera | str | None = None,
    stepping: Stepping | None = None,
    tone: Tone = SRGB,
    seed: int = 0,
) -> Iterator[Events]:
    """What a sensor sees of `frames`, one `Events` for each frame after the first; a few frames are in memory.

    Frames are grey (h w) or RGB (h w 3): whole numbers up to their type's maximum, or floats in 0 … 1, both in `tone`
    (`Tone("linear")` for light itself, which may pass 1). `stamps` are µs and ascend. `sensor` is a `PixelSettings`, or
    the name of a camera (`CAMERAS`) for its pixels; frames keep their size. The same input and seed give the same
    events.

        events = Events.concatenate(list(simulate(frames, stamps)), sensor)
    """
    if isinstance(sensor, str):
        sensor = camera_named(sensor)
    pixels = sensor.pixels if isinstance(sensor, Camera) else sensor or PixelSettings()
    shown = (Frame(float(t), light_of(frame, tone)) for frame, t in zip(frames, stamps, strict=True))
    with EventSimulator(pixels.traits, stepping, seed) as simulator:
        for index, (_, events) in enumerate(simulator.run(shown)):
            if index:
                yield events
        rest = simulator.finish()
        if len(rest):
            yield rest


def light_of(picture: Shaped[np.ndarray, "h w *c"], tone: Tone, name: str = "a frame") -> Float32[np.ndarray, "h w"]:
    """Linear light of a grey or RGB picture in its own depth."""
    if picture.ndim not in (2, 3) or picture.dtype.kind not in "uf" or (picture.ndim == 3 and picture.shape[2] != 3):
        raise RecordingError(
            f"{name}: is {picture.dtype} of the shape {picture.shape}; wanted (h, w) or (h, w, 3) of unsigned whole "
            "numbers or floats"
        )
    if picture.dtype.kind == "f" and not np.isfinite(picture).all():
        raise RecordingError(f"{name}: holds values that are no numbers, or infinite; wanted 0 … 1, 1 being white")
    top = np.iinfo(picture.dtype).max if picture.dtype.kind == "u" else 1.0
    code = picture.astype(np.float32) / np.float32(top)
    # Light itself has no brightest value, as a renderer's lamps are brighter than white.
    light = np.maximum(code, 0) if tone.curve == "linear" else tone.light(code).astype(np.float32)
    # Luminance of linear light, ITU-R BT.709.
    return light if light.ndim == 2 else cv2.transform(light, np.array([[0.2126, 0.7152, 0.0722]], np.float32))
