"""One picture from a file, in its own depth: whole numbers in a display's tone, or floats, which are light."""

from __future__ import annotations

from pathlib import Path

import av
import cv2
import numpy as np
from av.error import FFmpegError
from jaxtyping import Shaped, UInt8

from etnet.errors import RecordingError
from etnet.simulation.tone import Tone

SUFFIXES = {".png", ".jpg", ".jpeg", ".webp", ".bmp", ".tif", ".tiff", ".exr", ".pgm"}

Picture = Shaped[np.ndarray, "h w *c"]
"""Grey, or red, green, blue."""


def read_picture(path: Path) -> Picture:
    """A grey or RGB picture in its own depth."""
    if path.suffix.lower() == ".exr":
        return _read_exr(path)
    picture = cv2.imread(str(path), cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR)
    if picture is None:
        raise RecordingError(f"{path.name}: cannot be read as a picture")
    return picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., 2::-1])


def assumed_tone(picture: Picture, remarks: list[str]) -> Tone:
    """The tone of pictures like this one, which no file states; what is assumed is added to `remarks`."""
    is_light = picture.dtype.kind == "f"
    remarks.append(
        "values are floats: taken as light itself, 1 being white (--gamma takes a tone)"
        if is_light
        else "pictures state no transfer curve; taken as sRGB (--gamma takes another)"
    )
    return Tone("linear" if is_light else "srgb")


def colour_of(picture: Picture) -> UInt8[np.ndarray, "h w 3"]:
    """Blue, green, red in a display's tone, 8 bits, of a picture in colour."""
    if picture.dtype.kind == "f":
        picture = Tone("srgb").code(picture) * np.float32(255)
    elif picture.dtype != np.uint8:
        picture = picture.astype(np.float32) * np.float32(255 / np.iinfo(picture.dtype).max)
    return np.ascontiguousarray(np.rint(picture).astype(np.uint8)[..., ::-1])


def _read_exr(path: Path) -> Picture:
    """By FFmpeg: OpenCV's wheels have no decoder of it."""
    try:
        with av.open(str(path)) as container:
            picture = next(container.decode(video=0)).to_ndarray()
    except (FFmpegError, OSError, StopIteration, ValueError, IndexError) as error:
        raise RecordingError(f"{path.name}: cannot be read as a picture ({error})") from error
    return picture[..., :3] if picture.ndim == 3 else picture
