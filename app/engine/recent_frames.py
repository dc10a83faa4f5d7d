"""Frames that were given lately, at hand for any thread: they are shown again without waiting for the model."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import replace
from threading import Lock

from app.catalogue.recording_id import is_of
from app.engine.requests import FrameRequest, Ready

LARGEST = 32 << 20
"""Bytes of frames kept at hand; they are shared with the playback's own until it lets them go."""


class RecentFrames:
    """The newest exact replies by what was wished for, without their attention."""

    def __init__(self, largest: int = LARGEST) -> None:
        self._largest = largest
        self._held: OrderedDict[tuple[object, ...], Ready] = OrderedDict()
        self._nbytes = 0
        self._lock = Lock()

    def keep(self, ready: Ready) -> None:
        """Keep a reply; previews are not worth it. The oldest go when there is no room."""
        if ready.is_approximate:
            return
        key = _key(ready.request)
        with self._lock:
            before = self._held.pop(key, None)
            self._nbytes += ready.frame.nbytes - (0 if before is None else before.frame.nbytes)
            self._held[key] = replace(ready, attention=None)
            while self._nbytes > self._largest:
                self._nbytes -= self._held.popitem(last=False)[1].frame.nbytes

    def forget(self, recording_id: str) -> None:
        """Forget a recording's frames."""
        with self._lock:
            for key in [key for key in self._held if is_of(str(key[0]), recording_id)]:
                self._nbytes -= self._held.pop(key).frame.nbytes

    def find(self, request: FrameRequest) -> Ready | None:
        """The reply to the same request, as it was given then."""
        with self._lock:
            ready = self._held.get(_key(request))
        return None if ready is None else replace(ready, request=request, milliseconds=0.0)


def _key(request: FrameRequest) -> tuple[object, ...]:
    return (*request.playback, *request.frame)
