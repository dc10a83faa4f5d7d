"""Small films as people have them, written by FFmpeg's libraries."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import numpy as np


def drifting(num_frames: int, speed: float = 1.0, size: tuple[int, int] = (64, 48), kind=np.uint8) -> list[np.ndarray]:
    """Soft waves that drift to the left; `size` is (width, height)."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    top = np.iinfo(kind).max / 255
    return [
        np.rint((128 + 70 * np.sin((x + speed * i) / 6) * np.cos(y / 7)) * top).astype(kind) for i in range(num_frames)
    ]


def write_film(
    path: Path,
    pictures: Sequence[np.ndarray],
    stamps: Sequence[float] | float = 30.0,
    codec: str = "libx264",
    pixels: str = "yuv420p",
    options: dict[str, str] | None = None,
    rotation: float = 0.0,
    transfer: int | None = None,
) -> Path:
    """Grey or RGB pictures at `stamps` (seconds, or a rate) as a film."""
    every = [i / stamps for i in range(len(pictures))] if isinstance(stamps, float) else stamps
    tick = Fraction(1, 1000)
    form = "rgb24" if pictures[0].ndim == 3 else "gray" if pictures[0].dtype == np.uint8 else "gray16le"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(30), options=options or {})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pixels
        stream.time_base = stream.codec_context.time_base = tick
        if rotation:
            stream.set_display_rotation(rotation)
        if transfer is not None:
            stream.codec_context.color_trc = transfer
        for picture, stamp in zip(pictures, every, strict=True):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), form)
            frame.pts, frame.time_base = round(stamp * 1000), tick
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path
