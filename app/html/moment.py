"""One window of one recording, ready to be drawn: its events and voxel grid are read once for all panels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import overload

import numpy as np
from jaxtyping import Float32

from app.catalogue.cut import CutRecording
from app.catalogue.recording_id import is_of
from etnet.byte_cache import ByteCache
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.events import Events
from etnet.events.recording import Recording
from etnet.voxel import voxel_array
from etnet.windows import Policy, Window

NUM_BINS = 5

PICTURES = ByteCache(64 << 20)
"""Encoded pictures and panels of all visitors."""
ARRAYS = ByteCache(96 << 20)
"""Events and voxel grids of the moments that were last looked at."""


@dataclass(frozen=True)
class Moment:
    """Equal moments (same recording, policy and index) have equal pictures, for every visitor."""

    recording_id: str
    policy: Policy
    index: int
    recording: Recording = field(compare=False, repr=False)
    windows: Sequence[Window] = field(compare=False, repr=False)
    cleaning: Cleaning = UNCLEANED
    """What was taken out of the recording's events; `recording` has what is left."""

    @property
    def key(self) -> tuple[object, ...]:
        """What tells this moment from every other."""
        return self.recording_id, self.policy, self.index, self.cleaning

    @property
    def window(self) -> Window:
        """The current window."""
        return ARRAYS.get(("window", *self.key), lambda: self.windows[self.index])

    @property
    def events(self) -> Events:
        """The window's events."""
        window = self.window
        return ARRAYS.get(("events", *self.key), lambda: self.recording.read(window.start, window.stop), _events_bytes)

    @property
    def voxel(self) -> Float32[np.ndarray, "bins h w"]:
        """The window's voxel grid, without the normalisation that some models add."""
        return ARRAYS.get(("voxel", *self.key), lambda: voxel_array(self.events, NUM_BINS), lambda grid: grid.nbytes)

    @property
    def seconds(self) -> tuple[float, float]:
        """Start and end of the window in seconds since the recording's first event."""
        start = self.recording.span.start
        return (self.window.t_start - start) / 1e6, (self.window.t_stop - start) / 1e6

    @property
    def events_per_pixel(self) -> float:
        """How dense the window is."""
        return self.window.num_events / self.recording.sensor.num_pixels


def forget_recording(recording_id: str) -> None:
    """Forget every picture and array of a recording, whatever was computed of it under whichever of its ids."""
    for shared in (PICTURES, ARRAYS):
        shared.forget(lambda key: is_about(key, recording_id))


def is_about(key: object, recording_id: str) -> bool:
    """Whether a key names a recording: by its id, or by a moment, request or job that holds it."""
    if isinstance(key, str):
        return is_of(key, recording_id)
    if isinstance(key, tuple):
        return any(is_about(part, recording_id) for part in key)
    return is_dataclass(key) and any(is_about(getattr(key, part.name), recording_id) for part in fields(key))


def newest_of(moment: Moment) -> Moment:
    """What came last of a live recording, as a moment of its own that no window of the network is."""
    recording = moment.recording
    window = recording.newest if isinstance(recording, CutRecording) else None
    if window is None:
        return moment
    return Moment(f"{moment.recording_id} now", moment.policy, window.stop, recording, _Only(window))


class _Only(Sequence[Window]):
    """One window, whatever its number."""

    def __init__(self, window: Window) -> None:
        self._window = window

    def __len__(self) -> int:
        return 1

    @overload
    def __getitem__(self, index: int) -> Window: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Window]: ...
    def __getitem__(self, index: int | slice) -> Window | Sequence[Window]:
        return [self._window][index] if isinstance(index, slice) else self._window


def _events_bytes(events: Events) -> int:
    return 13 * len(events)
