"""The first seconds of a film, kept so that another sensor sees them at once: what a slider needs.

Decoding and the search for motion do not depend on the sensor. So both are done once for the first seconds, and a film
under another setting begins with the pixels' work alone. It is the same film to the bit.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from threading import Lock
from typing import Any, NamedTuple

from etnet.simulation.footage import Frame

SECONDS = 2.0
MOST_BYTES = 192 << 20
"""Memory of one beginning: 2 s of 30 frames a second at 320×240, with ten steps between two frames."""


class _Known(NamedTuple):
    version: Hashable
    value: Any
    num_bytes: int


class Beginning:
    """What is known of a film's first frames, by frame. Safe from every thread; one for a video and a size."""

    def __init__(self, seconds: float = SECONDS, most_bytes: int = MOST_BYTES) -> None:
        self._lock = Lock()
        self._seconds, self._most_bytes, self._num_bytes = seconds, most_bytes, 0
        self._frames: list[Frame] = []
        self._is_full = False
        self._known: dict[tuple[Frame, str], _Known] = {}

    @property
    def num_frames(self) -> int:
        """Frames that are kept by now."""
        with self._lock:
            return len(self._frames)

    def frames(self, footage: Iterable[Frame]) -> Iterator[Frame]:
        """All frames of the footage: those that are kept at once, the others as they are decoded.

        The footage is always read from its first frame on, so that it tells the same of itself.
        """
        with self._lock:
            kept = tuple(self._frames)
        yield from kept
        for index, frame in enumerate(footage):
            if index >= len(kept):
                self._keep(index, frame)
                yield frame

    def holds(self, frame: Frame) -> bool:
        """Whether it is one of the frames that are kept."""
        with self._lock:
            return frame in self._frames

    def known(self, frame: Frame, what: str, version: Hashable) -> Any | None:
        """What was kept of a frame under this name, if it is of this version; else None."""
        with self._lock:
            held = self._known.get((frame, what))
        return held.value if held is not None and held.version == version else None

    def keep(self, frame: Frame, what: str, version: Hashable, value: Any, num_bytes: int) -> None:
        """Keep what was found of a frame, if it is one of the first and there is room. The newest version stays."""
        with self._lock:
            if frame not in self._frames:
                return
            former = self._known.pop((frame, what), None)
            self._num_bytes -= 0 if former is None else former.num_bytes
            if self._num_bytes + num_bytes <= self._most_bytes:
                self._num_bytes += num_bytes
                self._known[frame, what] = _Known(version, value, num_bytes)

    def _keep(self, index: int, frame: Frame) -> None:
        num_bytes = frame.light.nbytes + (0 if frame.colour is None else frame.colour.nbytes)
        with self._lock:
            if self._is_full or index != len(self._frames):
                return
            if frame.t > self._seconds * 1e6 or self._num_bytes + num_bytes > self._most_bytes:
                self._is_full = True
                return
            self._num_bytes += num_bytes
            self._frames.append(frame)
