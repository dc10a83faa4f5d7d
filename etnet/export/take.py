"""What is taken away: some windows of a recording under one model, moment by moment, with progress and cancel."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float32

from etnet.errors import Cancelled, WindowError
from etnet.events.events import Events
from etnet.events.recording import Recording
from etnet.nets.attention import AttentionProbe
from etnet.nets.base import Step
from etnet.playback.playback import Playback
from etnet.stretch import nearest_window
from etnet.windows import Window

Progress = Callable[[int, int], None]
"""Told (windows done, windows wanted)."""
IsCancelled = Callable[[], bool]
"""Asked between windows; true ends the work with `Cancelled`, and nothing half-written stays."""


@dataclass(frozen=True)
class Moment:
    """One window of a take: what the network made of it and what else is known of that moment."""

    recording: Recording
    window: Window
    step: Step
    beside: tuple[Moment, ...] = ()
    """What the runs beside the take's own show at this moment."""
    frame_offset: int = 0
    """µs that are added to the camera frames' stamps."""

    @cached_property
    def frame(self) -> Float32[np.ndarray, "h w"]:
        """The raw, unclipped frame."""
        return self.step.frame[0, 0].float().cpu().numpy()

    @cached_property
    def events(self) -> Events:
        """The window's events."""
        return self.recording.read(self.window.start, self.window.stop)

    @property
    def seconds(self) -> float:
        """The frame's stamp, from the recording's first event."""
        return (self.window.t_stop - self.recording.span.start) / 1e6

    @cached_property
    def camera(self) -> Float32[np.ndarray, "h w"] | None:
        """The camera's frame nearest to the stamp, 0 … 1; `None` where the recording has none."""
        truth, index = self.recording.ground_truth, self._camera_index
        return None if truth is None or index is None else truth.read_frame(index)

    @property
    def camera_lag(self) -> int | None:
        """µs by which that frame was taken after the stamp."""
        truth, index = self.recording.ground_truth, self._camera_index
        if truth is None or index is None:
            return None
        return int(truth.stamps[index]) + self.frame_offset - self.window.t_stop

    @property
    def _camera_index(self) -> int | None:
        truth = self.recording.ground_truth
        return truth.nearest(self.window.t_stop - self.frame_offset) if truth is not None and len(truth) else None


@dataclass(frozen=True)
class Beside:
    """Another run of the same recording: at each moment it shows its window that ends nearest."""

    playback: Playback
    is_same_plan: bool = False
    """Its windows are the take's, number for number; some may end at one stamp."""

    def moment(self, window: Window, frame_offset: int, is_cancelled: IsCancelled | None) -> Moment:
        """What it shows beside `window`."""
        windows = self.playback.windows
        is_known = self.is_same_plan and window.index < len(windows)
        index = window.index if is_known else nearest_window(windows, window.t_stop)
        step = self.playback.at(index, cancelled=is_cancelled)
        return Moment(self.playback.recording, windows[index], step, (), frame_offset)


@dataclass(frozen=True)
class Take:
    """Windows `start` … `stop` − 1 of a playback. What leads up to `start` is replayed, so frames are exact."""

    playback: Playback
    start: int
    stop: int
    beside: tuple[Beside, ...] = ()
    """Runs that are drawn beside it; what is not drawn leaves them out."""
    frame_offset: int = 0
    """µs that are added to the camera frames' stamps."""

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.stop <= len(self.playback):
            raise WindowError(
                f"{self.playback.recording.name}: windows {self.start}:{self.stop} were asked for; it has "
                f"{len(self.playback)}, so a range lies in 0:{len(self.playback)} and holds at least one"
            )

    @staticmethod
    def of(playback: Playback, start: int | None = None, stop: int | None = None) -> Take:
        """A range, all of it by default."""
        return Take(playback, 0 if start is None else start, len(playback) if stop is None else stop)

    def __len__(self) -> int:
        return self.stop - self.start

    @property
    def recording(self) -> Recording:
        """Where the events come from."""
        return self.playback.recording

    @property
    def windows(self) -> Sequence[Window]:
        """The windows of the range, in order."""
        return [self.playback.windows[i] for i in range(self.start, self.stop)]

    def moments(
        self,
        probe: AttentionProbe | None = None,
        progress: Progress | None = None,
        is_cancelled: IsCancelled | None = None,
    ) -> Iterator[Moment]:
        """Every moment in order. `probe` adds attention; progress counts the moments that were handed on."""
        for done, window in enumerate(self.windows):
            step = self.playback.at(window.index, probe, cancelled=is_cancelled)
            beside = tuple(run.moment(window, self.frame_offset, is_cancelled) for run in self.beside)
            yield Moment(self.recording, window, step, beside, self.frame_offset)
            if is_cancelled is not None and is_cancelled():
                raise Cancelled(f"{self.recording.name}: export was stopped after {done + 1} of {len(self)} windows")
            if progress is not None:
                progress(done + 1, len(self))
