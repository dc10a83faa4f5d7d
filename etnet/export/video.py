"""H.264 video and GIF that play in a browser, encoded in this process by FFmpeg's libraries, one frame at a time."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from etnet.errors import EtnetError
from etnet.export.pace import Pace, pace_of
from etnet.export.pictures import Look, Picture, draw
from etnet.export.take import IsCancelled, Progress, Take
from etnet.files import check_target

if TYPE_CHECKING:
    import av

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
    frames_per_second: float | None = None,
) -> int:
    """The take as MP4 at `speed` times real time; returns the number of frames in the file."""
    pace = pace_of(take.windows, speed, frames_per_second=frames_per_second)
    return _write(take, path, look, pace, video_writer, progress, is_cancelled)


def write_gif(
    take: Take,
    path: Path,
    look: Look,
    speed: float = 1.0,
    progress: Progress | None = None,
    is_cancelled: IsCancelled | None = None,
    frames_per_second: float | None = None,
) -> int:
    """The take as a GIF that loops; at most 50 frames a second. Returns the number of frames in the file."""
    pace = pace_of(take.windows, speed, GIF_FASTEST, frames_per_second)
    return _write(take, path, look, pace, gif_writer, progress, is_cancelled)


def video_writer(
    path: Path, width: int, height: int, frames_per_second: float, is_grey: bool = True
) -> AbstractContextManager[FrameSink]:
    """Write frames to an MP4; it appears under `path` whole, or not at all.

    Odd sizes are padded by one line, because H.264's usual pixel format halves the colour planes.
    """
    kind = _Kind("mp4", "libx264", "yuv420p", {"crf": "17"}, {"movflags": "+faststart"}, 2)
    return _writer(path, (width, height), frames_per_second, is_grey, kind)


def gif_writer(
    path: Path, width: int, height: int, frames_per_second: float, is_grey: bool = True
) -> AbstractContextManager[FrameSink]:
    """Write frames to a looping GIF; grey frames lose nothing, colours get the best 256 of each frame."""
    kind = _Kind("gif", "gif", "gray" if is_grey else "pal8", {}, {"loop": "0"}, 1)
    return _writer(path, (width, height), frames_per_second, is_grey, kind)


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


@dataclass(frozen=True, slots=True)
class _Kind:
    """A container with its codec, pixel format and options; sides are padded to a multiple."""

    container: str
    codec: str
    pixel_format: str
    options: dict[str, str]
    container_options: dict[str, str]
    multiple: int


@contextmanager
def _writer(
    path: Path, size: tuple[int, int], frames_per_second: float, is_grey: bool, kind: _Kind
) -> Generator[FrameSink]:
    import av

    check_target(path)
    width, height = size
    padding = [(0, -height % kind.multiple), (0, -width % kind.multiple), (0, 0)][: 2 if is_grey else 3]
    shape = (height, width) if is_grey else (height, width, 3)
    temporary = path.with_name(f"{path.stem}.{os.getpid()}.tmp{path.suffix or '.' + kind.container}")
    rate = Fraction(frames_per_second).limit_denominator(10_000)
    num_frames = 0
    try:
        with av.open(str(temporary), "w", format=kind.container, container_options=kind.container_options) as output:
            stream = cast("av.VideoStream", output.add_stream(kind.codec, rate=rate, options=kind.options))
            stream.width, stream.height = width + padding[1][1], height + padding[0][1]
            stream.pix_fmt = kind.pixel_format
            brought = _palette(stream.width, stream.height) if kind.pixel_format == "pal8" else None

            def sink(image: Picture) -> None:
                nonlocal num_frames
                if image.shape != shape:
                    raise EtnetError(f"{path.name}: a frame is {image.shape}, the video is {shape}")
                padded = np.ascontiguousarray(np.pad(image, padding, mode="edge"))
                frame = av.VideoFrame.from_ndarray(padded, "gray" if is_grey else "rgb24")
                for ready in [frame] if brought is None else brought(frame):
                    ready.pts, ready.time_base = num_frames, 1 / rate
                    output.mux(stream.encode(ready))
                    num_frames += 1

            yield sink
            output.mux(stream.encode(None))
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _palette(width: int, height: int) -> Callable[[av.VideoFrame], Iterator[av.VideoFrame]]:
    """Brings each frame to the 256 colours that suit it best."""
    import av
    from av.error import BlockingIOError as NotYet
    from av.error import EOFError as Over
    from av.filter import Graph

    graph = Graph()
    source = graph.add_buffer(width=width, height=height, format=av.VideoFormat("rgb24"), time_base=Fraction(1, 1000))
    split = graph.add("split")
    made = graph.add("palettegen", "stats_mode=single")
    used = graph.add("paletteuse", "new=1:dither=none")
    sink = graph.add("buffersink")
    source.link_to(split)
    split.link_to(made, 0, 0)
    split.link_to(used, 1, 0)
    made.link_to(used, 0, 1)
    used.link_to(sink)
    graph.configure()
    num_frames = 0

    def brought(frame: av.VideoFrame) -> Iterator[av.VideoFrame]:
        nonlocal num_frames
        frame.pts, frame.time_base = num_frames, Fraction(1, 1000)
        num_frames += 1
        graph.push(frame)
        while True:
            try:
                yield graph.pull()  # pyright: ignore[reportReturnType]
            except (NotYet, Over):
                return

    return brought
