"""Videos as footage, decoded by FFmpeg's libraries (PyAV): true stamps, upright, progressive, in their own depth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path

import av
import numpy as np
from av.error import BlockingIOError as NotYet
from av.error import EOFError as Over
from av.error import FFmpegError
from av.filter import Graph
from jaxtyping import Float32, Shaped, UInt8

from etnet.errors import RecordingError
from etnet.simulation.footage import Frame, Framing
from etnet.simulation.repeats import is_same, told_repeats
from etnet.simulation.tone import Curve, Tone, light_table

_CURVES: dict[int, Curve] = dict.fromkeys((1, 6, 14, 15), "bt709")
_CURVES |= {8: "linear", 13: "srgb", 16: "pq", 18: "hlg"}
_GAMMAS = {4: 2.2, 5: 2.8}
"""Transfer characteristics of ITU-T H.273, table 3."""
_FULL = 2
_UNEVEN = 1.5
"""A longest interval so many times the shortest is told."""
_TAIL = 0.25
"""Seconds by which the last frame may come before the stated end."""


@dataclass(frozen=True, slots=True)
class Luma:
    """How a decoded picture holds its grey: bits of a sample, limited or full range, the curve of its tone."""

    bits: int
    is_limited: bool
    is_plane: bool
    tone: Tone


class VideoFootage:
    """A video's frames as light with the file's own stamps."""

    is_fine = False

    def __init__(
        self,
        path: Path,
        framing: Framing | None = None,
        gamma: float = 2.2,
        drops_repeats: bool = False,
        has_colour: bool = False,
    ) -> None:
        if not path.is_file():
            raise RecordingError(f"{path.name}: there is no such video")
        self.name, self.remarks = path.name, list[str]()
        self._framing, self._drops_repeats, self._has_colour = framing or Framing(), drops_repeats, has_colour
        try:
            self._container = av.open(str(path))
        except (FFmpegError, OSError) as error:
            raise RecordingError(f"{path.name}: {_why_not(path, error)}") from error
        if not self._container.streams.video:
            self.close()
            raise RecordingError(f"{path.name}: holds no video stream; choose a video, or a folder of pictures")
        self._stream = self._container.streams.video[0]
        self._stream.thread_type = "AUTO"
        self._decoded = self._pictures()
        first = next(self._decoded, None)
        if first is None:
            self.close()
            raise RecordingError(f"{path.name}: holds 0 frames that can be read; events need two")
        self._decoded = chain([first], self._decoded)
        # Taken now: a stream that is asked after its file was closed answers nonsense.
        rate = self._stream.average_rate or self._stream.guessed_rate or Fraction(25)
        self.interval = 1e6 / float(rate) / self._framing.speed
        self._whole = self._whole_seconds()
        self.duration = self._stated_seconds() / self._framing.speed
        self.luma = _luma(first, gamma)
        self.tone, self.bits = self.luma.tone, first.format.components[0].bits
        self._turns = round(first.rotation / 90) % 4
        width, height = (first.width, first.height) if self._turns % 2 == 0 else (first.height, first.width)
        self.sensor = self._framing.sensor(width, height, self.name)
        self._tell(first)

    def __iter__(self) -> Iterator[Frame]:
        origin: float | None = None
        before: np.ndarray | None = None
        last, shortest, longest, num_frames, num_repeats, num_dropped = -1.0, np.inf, 0.0, 0, 0, 0
        for picture in self._decoded:
            t = self._time(picture, last)
            if t < self._framing.start:
                continue
            if self._framing.stop is not None and t > self._framing.stop:
                break
            origin = t if origin is None else origin
            if num_frames and t <= last:
                num_dropped += 1
                continue
            grey = self._grey(picture)
            if before is not None and grey.shape != before.shape:
                self._tell_size(before, grey, t)
            is_repeat = before is not None and is_same(grey, before, self.luma.bits)
            num_repeats += is_repeat
            if is_repeat and self._drops_repeats:
                continue
            if num_frames:
                shortest, longest = min(shortest, t - last), max(longest, t - last)
            before, last, num_frames = grey, t, num_frames + 1
            yield Frame((t - origin) * 1e6 / self._framing.speed, self._light(grey), self._colour(picture))
        self._tell_counts(num_frames, num_repeats, num_dropped, shortest, longest)
        whole = self.duration * self._framing.speed + self._framing.start
        if last + max(longest, 0.0) + _TAIL < whole:
            self.remarks.append(f"breaks off at {last:.1f} s of the {whole:.1f} s that it states: it is not whole")
        if num_frames < 2:
            raise RecordingError(f"{self.name}: {self._too_few(num_frames)}")

    def close(self) -> None:
        """Give back the file."""
        self._container.close()

    def _too_few(self, num_frames: int) -> str:
        framing = self._framing
        frames = f"{num_frames} frame{'s' * (num_frames != 1)}"
        if framing.start == 0 and framing.stop is None:
            return f"holds {frames} that can be read; events need two"
        part = f"from {framing.start:g} s" + ("" if framing.stop is None else f" to {framing.stop:g} s")
        return f"has {frames} {part}, and is {self._whole:.1f} s long; events need two: choose another part"

    def _pictures(self) -> Iterator[av.VideoFrame]:
        """Decoded, de-interlaced from the first interlaced frame on; ends where the file breaks off."""
        deinterlace, num_frames, num_interlaced = None, 0, 0
        if self._framing.start > 1 and self._stream.time_base:
            began = self._stream.start_time or 0
            self._container.seek(began + int(self._framing.start / self._stream.time_base), stream=self._stream)
        try:
            for picture in self._container.decode(self._stream):
                if deinterlace is None and picture.interlaced_frame:
                    deinterlace = _Deinterlacer(self._stream)
                num_frames, num_interlaced = num_frames + 1, num_interlaced + bool(picture.interlaced_frame)
                yield from [picture] if deinterlace is None else deinterlace.take(picture)
        except (FFmpegError, OSError) as error:
            if num_frames == 0:
                raise RecordingError(f"{self.name}: cannot be read as a video ({_reason(error)})") from error
            self.remarks.append(f"breaks off after {num_frames} frames ({_reason(error)}); what came before is used")
        if deinterlace is not None:
            yield from deinterlace.take(None)
            share = "" if num_interlaced == num_frames else f" ({num_interlaced} of {num_frames} frames are)"
            self.remarks.append(f"interlaced{share}: each field became a frame (bwdif)")

    def _stated_seconds(self) -> float:
        """Length of the part that is seen, as the file states it; at least one frame's."""
        seconds = self._whole
        stop = min(self._framing.stop or seconds, seconds) if seconds else self._framing.stop or 0.0
        return max(stop - self._framing.start, self.interval * self._framing.speed / 1e6)

    def _whole_seconds(self) -> float:
        """Length of all of it, as the file states it; 0 where it does not."""
        if self._stream.duration and self._stream.time_base:
            return float(self._stream.duration * self._stream.time_base)
        return self._container.duration / 1e6 if self._container.duration else 0.0

    def _time(self, picture: av.VideoFrame, last: float) -> float:
        if picture.time is None:
            told = "has frames without a time; they are taken to follow at its mean rate"
            if told not in self.remarks:
                self.remarks.append(told)
            return 0.0 if last < 0 else last + self.interval * self._framing.speed / 1e6
        began = self._stream.start_time
        return picture.time - (float(began * self._stream.time_base) if began and self._stream.time_base else 0.0)

    def _grey(self, picture: av.VideoFrame) -> Shaped[np.ndarray, "_ _"]:
        if not self.luma.is_plane:
            picture = picture.reformat(format="gray16le", dst_color_range=_FULL)
        plane, kind = picture.planes[0], np.dtype(np.uint8 if self.luma.bits == 8 else "<u2")
        rows = np.frombuffer(memoryview(plane), np.uint8).reshape(-1, abs(plane.line_size))[: picture.height]
        return rows[:, : picture.width * kind.itemsize].copy().view(kind)

    def _light(self, grey: Shaped[np.ndarray, "_ _"]) -> Float32[np.ndarray, "h w"]:
        light = light_table(self.luma.tone, self.luma.bits, self.luma.is_limited)[grey]
        return self._framing.applied(np.rot90(light, self._turns), self.sensor, self.name)

    def _colour(self, picture: av.VideoFrame) -> UInt8[np.ndarray, "h w 3"] | None:
        if not self._has_colour:
            return None
        return self._framing.applied(np.rot90(picture.to_ndarray(format="bgr24"), self._turns), self.sensor, self.name)

    def _tell(self, first: av.VideoFrame) -> None:
        if int(first.color_trc) not in _CURVES and int(first.color_trc) not in _GAMMAS:
            self.remarks.append(f"states no transfer curve; taken as {self.tone} (--gamma takes another)")
        if self._stream.codec_context.name == "gif":
            self.remarks.append(
                "a GIF: the dots of its palette flicker and give events of their own; use the video it was made of"
            )
        if self._turns:
            self.remarks.append(f"turned upright by {self._turns * 90}°, as the file says")

    def _tell_size(self, before: Shaped[np.ndarray, "_ _"], grey: Shaped[np.ndarray, "_ _"], t: float) -> None:
        was, is_now = (f"{picture.shape[1]}×{picture.shape[0]}" for picture in (before, grey))
        told = f"its pictures change their size, from {was} to {is_now} "
        if not any(remark.startswith(told) for remark in self.remarks):
            self.remarks.append(f"{told}at {t:.2f} s; all are brought to the sensor's {self.sensor}")

    def _tell_counts(self, num_frames: int, num_repeats: int, num_dropped: int, shortest: float, longest: float):
        self.remarks += told_repeats(num_repeats, num_frames, self._drops_repeats)
        if num_dropped:
            self.remarks.append(f"{num_dropped} frames whose time does not come after the one before were left out")
        if longest > _UNEVEN * shortest:
            self.remarks.append(
                f"frames come at a variable rate, {shortest * 1e3:.1f} … {longest * 1e3:.1f} ms apart; "
                "each keeps its own time"
            )


class _Deinterlacer:
    """Makes a frame of each field, and leaves frames that are not interlaced as they are."""

    def __init__(self, stream: av.VideoStream) -> None:
        self._graph = Graph()
        source, sink = self._graph.add_buffer(template=stream), self._graph.add("buffersink")
        bwdif = self._graph.add("bwdif", "mode=send_field:deint=interlaced")
        source.link_to(bwdif)
        bwdif.link_to(sink)
        self._graph.configure()

    def take(self, picture: av.VideoFrame | None) -> Iterator[av.VideoFrame]:
        """Frames that are ready after `picture`; None asks for the last ones."""
        self._graph.push(picture)
        while True:
            try:
                yield self._graph.pull()  # pyright: ignore[reportReturnType]
            except (NotYet, Over):
                return


def _luma(first: av.VideoFrame, gamma: float) -> Luma:
    name, bits = first.format.name, first.format.components[0].bits
    is_plane = name.startswith(("yuv", "gray", "nv12", "nv21")) and (bits == 8 or name.endswith("le"))
    is_full = int(first.color_range) == _FULL or name.startswith(("yuvj", "gray"))
    curve = int(first.color_trc)
    tone = Tone(_CURVES.get(curve, "gamma"), _GAMMAS.get(curve, gamma))
    return Luma(bits if is_plane else 16, is_plane and not is_full, is_plane, tone)


def _why_not(path: Path, error: BaseException) -> str:
    """Why FFmpeg does not open a file, in the words of someone who has it on the disk."""
    size = path.stat().st_size
    if size == 0:
        return "is empty; copy it again"
    if _ends_before_its_index(path, size):
        return "ends before its index, so that nothing of it can be read: it is not whole; copy it again"
    return f"cannot be read as a video ({_reason(error)}); MP4 (H.264) always works"


def _ends_before_its_index(path: Path, size: int) -> bool:
    """Whether an MP4 or MOV (ISO/IEC 14496-12: boxes of length, name, content) breaks off and has no `moov` box."""
    with path.open("rb") as file:
        place, is_first = 0, True
        while place + 8 <= size:
            file.seek(place)
            head = file.read(16)
            length, name = int.from_bytes(head[:4], "big"), head[4:8]
            if is_first and name != b"ftyp":
                return False
            if name == b"moov":
                return False
            is_first, length = False, int.from_bytes(head[8:16], "big") if length == 1 else length
            if length < 8:
                return False
            place += length
    return not is_first and place > size


def _reason(error: BaseException) -> str:
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
