"""A stranger's video as footage, decoded in a process of its own: a crash, or too much of anything, is one sentence."""

from __future__ import annotations

import math
import os
import select
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.catalogue import video_child
from app.catalogue.child_process import end, started, why_it_ended
from app.catalogue.video_child import HEAD, MOMENT
from etnet.errors import Cancelled, RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.bounds import check_sensor
from etnet.plain_values import PlainError, bounded_json, fitted, made_of
from etnet.simulation.footage import Frame
from etnet.simulation.tone import Tone
from etnet.simulation.video import VideoConfig

SECONDS = 900
"""Of CPU time: decoding, which is a small part of what a simulation takes."""
SILENCE = 60.0
"""Seconds without a frame after which a video is given up."""
WRITTEN = 1 << 20
"""Bytes that it may write to a file: nothing that it does needs one."""
_ASK_EVERY = 0.2
_LONGEST_WORDS = 100_000


@dataclass(frozen=True, slots=True)
class _Facts:
    """What a video's decoder knows before its frames."""

    sensor: tuple[int, int]
    tone: Tone
    bits: int
    duration: float
    interval: float
    remarks: tuple[str, ...] = ()


class FootageApart:
    """A video's frames, as `VideoFootage` gives them, to the bit."""

    is_fine = False

    def __init__(self, path: Path, config: VideoConfig, is_cancelled: Callable[[], bool]) -> None:
        """`is_cancelled` is asked while it waits for a frame, and ends it with `Cancelled`."""
        if config.has_colour:
            raise RecordingError(f"{path.name}: a visitor's video is seen in grey alone")
        self.name = path.name
        self._is_cancelled = is_cancelled
        told = {
            "path": str(path), "seconds": SECONDS, "bytes": WRITTEN, "framing": asdict(config.seen),
            "gamma": config.gamma, "drops_repeats": config.drops_repeats,
        }  # fmt: skip
        self._child = started(video_child.__file__, told, path.parent)
        try:
            facts = self._facts()
        except BaseException:
            self.close()
            raise
        self.sensor, self.tone, self.bits = Sensor(*facts.sensor), facts.tone, facts.bits
        self.duration, self.interval = facts.duration, facts.interval
        self.remarks = list(facts.remarks)

    def __iter__(self) -> Iterator[Frame]:
        last, num_pixels = -math.inf, self.sensor.num_pixels
        while True:
            kind, content = self._block(MOMENT.size + 4 * num_pixels)
            if kind == b"j":
                self.remarks = list(fitted(tuple[str, ...], self._words(content).get("remarks", [])))
                return
            t, is_cut = MOMENT.unpack_from(content)
            light = np.frombuffer(content, "<f4", offset=MOMENT.size)
            if not (math.isfinite(t) and t > last) or light.size != num_pixels or not np.isfinite(light).all():
                raise RecordingError(f"{self.name}: its decoder gave what is no frame; the video may be damaged")
            last = t
            yield Frame(t, light.reshape(self.sensor.height, self.sensor.width).astype(np.float32), None, is_cut)

    def close(self) -> None:
        """End the process, whatever it does."""
        end(self._child, patience=0.0)
        assert self._child.stdout is not None
        self._child.stdout.close()

    def _facts(self) -> _Facts:
        kind, content = self._block(_LONGEST_WORDS)
        try:
            facts = made_of(_Facts, self._words(content) if kind == b"j" else None)
            check_sensor(Sensor(*facts.sensor), self.name)
        except (PlainError, ValueError) as error:
            raise RecordingError(f"{self.name}: its decoder ended oddly ({error})") from None
        if not (min(facts.sensor) >= 1 and 1 <= facts.bits <= 16 and facts.interval > 0 and facts.duration >= 0):
            raise RecordingError(f"{self.name}: its decoder ended oddly; the video may be damaged")
        return facts

    def _words(self, content: bytes) -> dict[str, Any]:
        words = bounded_json(content, _LONGEST_WORDS)
        if not isinstance(words, dict):
            raise PlainError("no words")
        if "failed" in words:
            raise RecordingError(str(words["failed"])[:500].replace("\n", " "))
        return words

    def _block(self, longest: int) -> tuple[bytes, bytes]:
        """The next block, of a frame's or words' length at most."""
        kind, length = HEAD.unpack(self._read(HEAD.size))
        if kind not in (b"j", b"f") or length > max(longest, _LONGEST_WORDS):
            raise RecordingError(f"{self.name}: its decoder gave what is no frame; the video may be damaged")
        if kind == b"f" and length != longest:
            raise RecordingError(f"{self.name}: its decoder gave what is no frame; the video may be damaged")
        return kind, self._read(length)

    def _read(self, count: int) -> bytes:
        assert self._child.stdout is not None
        descriptor, parts, ends = self._child.stdout.fileno(), bytearray(), time.monotonic() + SILENCE
        while len(parts) < count:
            if self._is_cancelled():
                raise Cancelled("its visitor has gone")
            if not select.select([descriptor], [], [], _ASK_EVERY)[0]:
                if time.monotonic() > ends:
                    raise RecordingError(f"{self.name}: no frame came for {SILENCE:.0f} s; it was stopped")
                continue
            part = os.read(descriptor, count - len(parts))
            if not part:
                raise RecordingError(f"{self.name}: {why_it_ended(self._child.wait())}")
            parts += part
        return bytes(parts)
