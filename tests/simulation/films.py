"""Small films as people have them, written by FFmpeg's libraries."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Literal

import av
import numpy as np
from av.filter import Graph


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
    fields: Literal["tff", "bff"] | None = None,
) -> Path:
    """Grey or RGB pictures at `stamps` (seconds, or a rate) as a film. With `fields` it is interlaced (H.264): the top
    (even) lines are seen first, or the bottom ones."""
    options = options or {}
    if fields:
        options = {**options, "x264-params": f"{fields}=1"}
    every = [i / stamps for i in range(len(pictures))] if isinstance(stamps, float) else stamps
    tick = Fraction(1, 1000)
    form = "rgb24" if pictures[0].ndim == 3 else "gray" if pictures[0].dtype == np.uint8 else "gray16le"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=Fraction(30), options=options)
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
            container.mux(stream.encode(_marked(frame, fields, pixels) if fields else frame))
        container.mux(stream.encode(None))
    return path


def _marked(frame: av.VideoFrame, fields: str, pixels: str) -> av.VideoFrame:
    """The frame, marked as two fields in this order: the encoder goes by the mark."""
    graph = Graph()
    source = graph.add_buffer(
        width=frame.width, height=frame.height, format=frame.format.name, time_base=frame.time_base
    )
    chain = source, graph.add("format", pixels), graph.add("setfield", fields), graph.add("buffersink")
    for one, other in pairwise(chain):
        one.link_to(other)
    graph.configure()
    graph.push(frame)
    return graph.pull()
