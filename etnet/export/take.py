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
        truth = self.recording.ground_truth
        if truth is None or len(truth) == 0:
            return None
        return truth.read_frame(truth.nearest(self.window.t_stop))


@dataclass(frozen=True)
class Take:
    """Windows `start` … `stop` − 1 of a playback. What leads up to `start` is replayed, so frames are exact."""

    playback: Playback
    start: int
    stop: int

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
            yield Moment(self.recording, window, step)
            if is_cancelled is not None and is_cancelled():
                raise Cancelled(f"{self.recording.name}: export was stopped after {done + 1} of {len(self)} windows")
            if progress is not None:
                progress(done + 1, len(self))
