"""Frames that were given lately, at hand for any thread: they are shown again without waiting for the model."""

from __future__ import annotations

from dataclasses import replace

from app.catalogue.recording_id import is_of
from app.engine.requests import FrameKey, FrameRequest, Ready
from etnet.byte_cache import ByteCache

LARGEST = 32 << 20
"""Bytes of frames kept at hand; they are shared with the playback's own until it lets them go."""


class RecentFrames:
    """The newest exact replies by what was wished for, without their attention."""

    def __init__(self, largest: int = LARGEST) -> None:
        self._held: ByteCache[FrameKey, Ready] = ByteCache(largest, overhead=0)

    def keep(self, ready: Ready) -> None:
        """Keep a reply; previews are not worth it. The oldest go when there is no room."""
        if not ready.is_approximate:
            self._held.keep(ready.request.key, replace(ready, attention=None), ready.frame.nbytes)

    def forget(self, recording_id: str) -> None:
        """Forget a recording's frames."""
        self._held.forget(lambda key: is_of(key[0].recording_id, recording_id))

    def find(self, request: FrameRequest) -> Ready | None:
        """The reply to the same request, as it was given then."""
        ready = self._held.find(request.key)
        return None if ready is None else replace(ready, request=request, milliseconds=0.0)

    def all(self) -> tuple[Ready, ...]:
        """Every reply held."""
        return self._held.values()
