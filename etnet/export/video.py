"""H.264 video and GIF that play in a browser, both through ffmpeg, one frame at a time."""

from __future__ import annotations

import os
from collections.abc import Generator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np

from etnet.errors import EtnetError
from etnet.export.pace import Pace, pace_of
from etnet.export.pictures import Look, Picture, draw
from etnet.export.take import IsCancelled, Progress, Take
from etnet.files import check_target

GIF_FASTEST = 50.0
"""Frames a second: a GIF counts in hundredths, and browsers slow down what is shorter than two of them."""


class FrameSink(Protocol):
    """Takes one frame after the other."""

    def __call__(self, image: Picture) -> None:
        """Append one frame; all have the same size."""
        ...


def write_video(
    take: Take,
    path: Path,
    look: Look,
    speed: float = 1.0,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> int:
    """The take as MP4 at `speed` times real time; returns the number of frames in the file."""
    return _write(take, path, look, pace_of(take.windows, speed), video_writer, progress, is_cancelled)


def write_gif(
    take: Take,
    path: Path,
    look: Look,
    speed: float = 1.0,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
) -> int:
    """The take as a GIF that loops; at most 50 frames a second. Returns the number of frames in the file."""
    return _write(take, path, look, pace_of(take.windows, speed, GIF_FASTEST), gif_writer, progress, is_cancelled)


def video_writer(
    path: Path, width: int, height: int, frames_per_second: float, is_grey: bool = True
) -> AbstractContextManager[FrameSink]:
    """Write frames to an MP4; it appears under `path` whole, or not at all.

    Odd sizes are padded by one line, because H.264's usual pixel format halves the colour planes.
    """
    options = ["-crf", "17", "-movflags", "+faststart"]
    return _writer(path, (width, height), frames_per_second, is_grey, "libx264", "yuv420p", options, 2)


def gif_writer(
    path: Path, width: int, height: int, frames_per_second: float, is_grey: bool = True
) -> AbstractContextManager[FrameSink]:
    """Write frames to a looping GIF; grey frames lose nothing, colours get the best 256 of each frame."""
    palette = "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none"
    options = ["-loop", "0"] if is_grey else ["-loop", "0", "-vf", palette]
    return _writer(path, (width, height), frames_per_second, is_grey, "gif", "gray" if is_grey else "pal8", options, 1)


def _write(
    take: Take,
    path: Path,
    look: Look,
    pace: Pace,
    writer,
    progress: Progress | None,
    is_cancelled: IsCancelled | None,
) -> int:
    moments = take.moments(progress=progress, is_cancelled=is_cancelled)
    first = next(moments)
    picture = draw(first, look, len(take.playback))
    height, width = picture.shape[:2]
    with writer(path, width, height, pace.frames_per_second, look.is_grey) as append:
        for _ in range(pace.repeats[0]):
            append(picture)
        for moment, repeats in zip(moments, pace.repeats[1:], strict=True):
            picture = draw(moment, look, len(take.playback))
            for _ in range(repeats):
                append(picture)
    return sum(pace.repeats)


@contextmanager
def _writer(
    path: Path,
    size: tuple[int, int],
    frames_per_second: float,
    is_grey: bool,
    codec: str,
    pixel_format: str,
    options: Sequence[str],
    multiple: int,
) -> Generator[FrameSink]:
    import imageio_ffmpeg

    check_target(path)
    width, height = size
    padded = (width + -width % multiple, height + -height % multiple)
    temporary = path.with_name(f"{path.stem}.{os.getpid()}.tmp{path.suffix or '.mp4'}")
    process = imageio_ffmpeg.write_frames(
        str(temporary),
        padded,
        pix_fmt_in="gray" if is_grey else "rgb24",
        pix_fmt_out=pixel_format,
        fps=frames_per_second,  # pyright: ignore[reportArgumentType]  any number works
        codec=codec,
        macro_block_size=1,
        output_params=list(options),
        ffmpeg_log_level="error",
    )
    process.send(None)
    shape = (height, width) if is_grey else (height, width, 3)
    padding = [(0, padded[1] - height), (0, padded[0] - width), (0, 0)][: len(shape)]

    def sink(image: Picture) -> None:
        if image.shape != shape:
            raise EtnetError(f"{path.name}: a frame is {image.shape}, the video is {shape}")
        process.send(np.pad(image, padding, mode="edge").tobytes())

    try:
        yield sink
        process.close()
        os.replace(temporary, path)
    finally:
        process.close()
        temporary.unlink(missing_ok=True)
