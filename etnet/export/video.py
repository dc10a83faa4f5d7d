"""H.264 video that plays in a browser."""

from __future__ import annotations

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np
from jaxtyping import UInt8

from etnet.errors import EtnetError


class FrameSink(Protocol):
    """Takes one frame after the other."""

    def __call__(self, image: UInt8[np.ndarray, "h w"]) -> None:
        """Append one grey frame; all have the same size."""
        ...


@contextmanager
def video_writer(path: Path, width: int, height: int, frames_per_second: float) -> Generator[FrameSink]:
    """Write grey frames to an MP4; it appears under `path` whole, or not at all.

    Odd sizes are padded by one line, because H.264's usual pixel format halves the colour planes.
    """
    import imageio_ffmpeg

    temporary = path.with_name(f"{path.stem}.{os.getpid()}.tmp.mp4")
    size = (width + width % 2, height + height % 2)
    process = imageio_ffmpeg.write_frames(
        str(temporary),
        size,
        pix_fmt_in="gray",
        fps=frames_per_second,  # pyright: ignore[reportArgumentType]  any number works
        codec="libx264",
        macro_block_size=1,
        output_params=["-crf", "17", "-movflags", "+faststart"],
        ffmpeg_log_level="error",
    )
    process.send(None)

    def sink(image: UInt8[np.ndarray, "h w"]) -> None:
        if image.shape != (height, width):
            raise EtnetError(f"{path.name}: a frame is {image.shape}, the video is {(height, width)}")
        process.send(np.pad(image, ((0, size[1] - height), (0, size[0] - width)), mode="edge").tobytes())

    try:
        yield sink
        process.close()
        os.replace(temporary, path)
    finally:
        process.close()
        temporary.unlink(missing_ok=True)
