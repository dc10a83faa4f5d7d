"""What other threads read of the engine: what is cached, how long steps take, frames and small copies of them."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from jaxtyping import Float16, Float32

from app.catalogue.recording_id import is_of
from app.engine.pace import Pace
from app.engine.playbacks import LoadedPlayback
from app.engine.replies import is_exact
from app.engine.requests import FrameKey, FrameRequest, PlaybackKey, Ready
from etnet.byte_cache import ByteCache

if TYPE_CHECKING:
    from etnet.nets.contract import Contract


INTERVAL = 0.2
"""Seconds between two reports of what is cached while a seek runs."""


@dataclass(frozen=True, slots=True)
class PlaybackCached:
    """What a playback holds, as ranges of windows, its bytes, and whether its frames may be called exact."""

    frames: tuple[range, ...]
    states: tuple[range, ...]
    nbytes: int
    is_exact: bool


class Published:
    """Written by the engine's thread; whole values replace each other, so anybody may read."""

    def __init__(self) -> None:
        self._cached: dict[PlaybackKey, PlaybackCached] = {}
        self._paces: dict[PlaybackKey, Pace] = {}
        self._precisions: dict[tuple[str, str], str] = {}
        self._told_at = 0.0

    def cached(self, request: FrameRequest) -> PlaybackCached | None:
        """Which frames and states are held for a request's playback."""
        return self._cached.get(request.playback)

    def pace(self, request: FrameRequest) -> Pace | None:
        """How fast a request's playback goes; `None` until it is loaded."""
        return self._paces.get(request.playback)

    def precision(self, request: FrameRequest) -> str | None:
        """The precision that a network runs in, where it was loaded."""
        return self._precisions.get((request.model_id, request.precision))

    def tell(self, request: FrameRequest, loaded: LoadedPlayback, at_once: bool = True) -> None:
        """Publish what is cached; unless `at_once`, not more often than is useful."""
        now = time.monotonic()
        if at_once or now - self._told_at > INTERVAL:
            self._told_at = now
            held = loaded.playback.cached()
            # Held, and told to all who share the playback, are frames of the original, whoever's change is at work.
            cached = PlaybackCached(held.frames, held.states, held.nbytes, is_exact(loaded, request.plain))
            self._cached[request.playback] = cached

    def tell_pace(self, request: FrameRequest, loaded: LoadedPlayback) -> None:
        """A playback is there."""
        self._paces[request.playback] = loaded.pace

    def tell_precision(self, model_id: str, precision: str, model: Any) -> None:
        """A network is there, loaded as `precision` asks."""
        runtime = getattr(model, "runtime", None)
        self._precisions[model_id, precision] = runtime.precision if runtime else "fp32"

    def keep_only(self, playbacks: Collection[PlaybackKey]) -> None:
        """Forget what was told of playbacks that are gone."""
        self._cached = {key: report for key, report in self._cached.items() if key in playbacks}
        self._paces = {key: pace for key, pace in self._paces.items() if key in playbacks}


LARGEST_FRAMES = 32 << 20
"""Bytes of frames kept at hand; they are shared with the playback's own until it lets them go."""


class RecentFrames:
    """The newest exact replies by what was wished for, without their attention."""

    def __init__(self, largest: int = LARGEST_FRAMES) -> None:
        self._held: ByteCache[FrameKey, Ready] = ByteCache(largest, overhead=0)

    def keep(self, ready: Ready) -> None:
        """Keep a reply; previews are not worth it. The oldest go when there is no room."""
        if not ready.is_approximate:
            self._held.keep(ready.request.key, replace(ready, attention=None), ready.frame.nbytes)

    def forget(self, recording_id: str) -> None:
        """Forget a recording's frames."""
        self._held.forget(lambda key: is_of(key[0].recording_id, recording_id))

    def keep_contract(self, playback: PlaybackKey, contract: Contract) -> None:
        """Forget the frames of a playback that another contract than this one made: all that is shown is of one run."""
        others = {
            ready.request.key
            for ready in self._held.values()
            if ready.request.playback == playback and ready.contract != contract
        }
        self._held.forget(lambda key: key in others)

    def find(self, request: FrameRequest) -> Ready | None:
        """The reply to the same request, as it was given then."""
        ready = self._held.find(request.key)
        return None if ready is None else replace(ready, request=request, milliseconds=0.0)

    def all(self) -> tuple[Ready, ...]:
        """Every reply held."""
        return self._held.values()


LARGEST_THUMBNAILS = 8 << 20
"""Bytes of all visitors' small frames: some 400 of them."""
THUMBNAIL_WIDTH = 116
"""Pixels of a small frame at most."""


class Thumbnails:
    """The newest small frames by what was asked for; the oldest go when there is no room."""

    def __init__(self, largest: int = LARGEST_THUMBNAILS) -> None:
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
    factor = min(THUMBNAIL_WIDTH / width, 1.0)
    size = max(round(width * factor), 1), max(round(height * factor), 1)
    return cv2.resize(frame, size, interpolation=cv2.INTER_AREA).astype(np.float16)
