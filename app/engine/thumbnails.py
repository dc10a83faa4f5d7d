"""Small copies of exact frames, at hand for any thread: what a pointer over the timeline sees."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float16, Float32

from app.catalogue.recording_id import is_of
from app.engine.requests import FrameKey, FrameRequest
from etnet.byte_cache import ByteCache

LARGEST = 8 << 20
"""Bytes of all visitors' small frames: some 400 of them."""
WIDTH = 116
"""Pixels of a small frame at most."""


class Thumbnails:
    """The newest small frames by what was asked for; the oldest go when there is no room."""

    def __init__(self, largest: int = LARGEST) -> None:
        self._held: ByteCache[FrameKey, Float16[np.ndarray, "h w"]] = ByteCache(largest, overhead=0)

    def keep(self, request: FrameRequest, frame: Float32[np.ndarray, "h w"]) -> None:
        """Keep a small copy of an exact frame, unless it is held."""
        self._held.get(request.key, lambda: _small(frame), lambda small: small.nbytes)

    def find(self, request: FrameRequest) -> Float32[np.ndarray, "h w"] | None:
        """The small frame of a request; `None` where none is held."""
        small = self._held.find(request.key)
        return None if small is None else small.astype(np.float32)

    def forget(self, recording_id: str) -> None:
        """Forget a recording's frames."""
        self._held.forget(lambda key: is_of(key[0].recording_id, recording_id))

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self._held.nbytes


def _small(frame: Float32[np.ndarray, "h w"]) -> Float16[np.ndarray, "h w"]:
    height, width = frame.shape
    factor = min(WIDTH / width, 1.0)
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    return cv2.resize(frame, size, interpolation=cv2.INTER_AREA).astype(np.float16)
