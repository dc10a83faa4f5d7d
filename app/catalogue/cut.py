"""Recordings whose windows were cut while they came: nobody plans these windows again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import overload

from etnet.errors import WindowError
from etnet.events.recording import Recording, Span
from etnet.live.buffer import Extent
from etnet.live.windows import KeptWindows
from etnet.windows import Policy, Window, plan_windows

NEWEST = 40_000
"""µs of events that are shown as what comes just now."""


class FirstKept(Sequence[Window]):
    """The first `length` windows of those that are kept: a value, while more are cut."""

    def __init__(self, kept: KeptWindows, length: int) -> None:
        self._kept, self._length = kept, length

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> Window: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Window]: ...
    def __getitem__(self, index: int | slice) -> Window | Sequence[Window]:
        if isinstance(index, slice):
            return [self._kept[i] for i in range(*index.indices(self._length))]
        if not -self._length <= index < self._length:
            raise IndexError(f"window {index} of {self._length}")
        return self._kept[index % self._length]


@dataclass(frozen=True, eq=False)
class CutRecording(Recording):
    """A recording with its windows `cut` under `policy`. `extent` says what of a live one is still held."""

    policy: Policy | None = None
    cut: Sequence[Window] = ()
    extent: Callable[[], Extent] | None = None
    """`None` for a file: all of it is there."""

    @property
    def is_live(self) -> bool:
        """Whether a source still feeds it, or fed it last."""
        return self.extent is not None

    def is_gone(self, window: Window) -> bool:
        """Whether events of a window have left the buffer."""
        return self.extent is not None and not self.extent().is_there(window.start, window.stop)

    @property
    def gone_before(self) -> float:
        """Seconds after the first event before which all has left the buffer; 0 while everything is there."""
        extent = None if self.extent is None else self.extent()
        if extent is None or extent.gone_before is None or extent.first_stamp is None:
            return 0.0
        return (extent.gone_before - extent.first_stamp) / 1e6

    @cached_property
    def axis(self) -> Span:
        """What a timeline runs over, µs: of a live one what was held since the network began, as this was first drawn.

        Hundreds of places are laid out on it for one picture, while events come and leave.
        """
        if not self.is_live:
            return self.span
        began = self.cut[0].t_start if self.cut else self.span.start
        return Span(min(max(began, self.span.start + round(1e6 * self.gone_before)), self.span.stop), self.span.stop)

    @property
    def newest(self) -> Window | None:
        """What came last, whether the network got to it or not; `None` of a file, and before anything came."""
        if self.extent is None or self.num_events == 0:
            return None
        stop = self.span.stop
        start = max(self.index_at(max(stop - NEWEST, self.span.start)), self.extent().first_held)
        return Window(0, min(start, self.num_events), self.num_events, stop - NEWEST, stop)

    @property
    def first_held(self) -> int:
        """The first window of which all events are there; the number of windows where there is none."""
        if self.extent is None:
            return 0
        held, low, high = self.extent().first_held, 0, len(self.cut)
        while low < high:
            middle = (low + high) // 2
            low, high = (middle + 1, high) if self.cut[middle].start < held else (low, middle)
        return low


def with_cut(
    recording: Recording,
    policy: Policy | None,
    cut: Sequence[Window],
    extent: Callable[[], Extent] | None = None,
    latest: Callable[[], Recording] | None = None,
) -> CutRecording:
    """The same recording with the windows that were cut of it."""
    held = {entry.name: getattr(recording, entry.name) for entry in fields(Recording)}
    return CutRecording(**{**held, "latest": latest}, policy=policy, cut=cut, extent=extent)


def is_live(recording: Recording) -> bool:
    """Whether a source feeds a recording, so that its beginning leaves it."""
    return isinstance(recording, CutRecording) and recording.is_live


def windows_of(recording: Recording, policy: Policy, former: Sequence[Window] | None = None) -> Sequence[Window]:
    """The windows of a recording: as they were cut, where its source was cut under this policy, else as planned.

    `former` is the plan when the recording was shorter.

    Raises:
        WindowError: windows of a live recording are asked for under another policy, or do not fit the recording.
    """
    if isinstance(recording, CutRecording) and policy == recording.policy:
        return recording.cut
    if is_live(recording):
        raise WindowError("live windows stay as they were cut; record, and open the file to cut it in another way")
    return plan_windows(recording, policy, former)
