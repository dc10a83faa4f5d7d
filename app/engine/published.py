"""What the engine publishes of its work, as values that other threads read: what is cached, how long steps take."""

from __future__ import annotations

import time
from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from app.engine.playbacks import LoadedPlayback, Pace
from app.engine.requests import FrameRequest, PlaybackKey

if TYPE_CHECKING:
    from etnet.playback.playback import CacheReport

INTERVAL = 0.2
"""Seconds between two reports of what is cached while a seek runs."""


class Published:
    """Written by the engine's thread; whole values replace each other, so anybody may read."""

    def __init__(self) -> None:
        self._cached: dict[PlaybackKey, CacheReport] = {}
        self._paces: dict[PlaybackKey, Pace] = {}
        self._precisions: dict[tuple[str, str], str] = {}
        self._told_at = 0.0

    def cached(self, request: FrameRequest) -> CacheReport | None:
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
            self._cached[request.playback] = loaded.playback.cached()

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
