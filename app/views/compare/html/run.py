"""One run of a comparison, ready to be drawn: what it is, what has come of it, what it is held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from app.engine.requests import Failed, FrameRequest, Ready, Working
from app.html.moment import ARRAYS, Moment
from app.html.pictures import Tones
from app.html.units import milliseconds, policy
from app.state.run import Run
from app.views.compare.state import NAMES, CompareState
from app.views.page import Page, RunFrame
from app.views.reconstruction.state import tones_in
from etnet.events.cleaning import Cleaning
from etnet.render.colours import RUNS, hexadecimal
from etnet.windows import Window

COLOURS = tuple(hexadecimal(colour) for colour in RUNS)
"""Of curves and marks, in the order of `NAMES`."""
SAME_TIME = 1_000
"""µs that window and camera frame may differ before the difference is called one (EVREAL's bound)."""


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """The camera frame that a run's frame is held against; `lag`: how much later it was taken, µs.

    Its stamp (µs) names it: frames of a live recording change their numbers when the first ones are forgotten.
    """

    index: int
    lag: int
    stamp: int


@dataclass(frozen=True, slots=True, eq=False)
class RunShown:
    """A run as it stands now. `request` is `None` until its windows are planned; `window` is the nearest in time."""

    number: int
    run: Run
    request: FrameRequest | None
    window: Window | None
    num_windows: int
    model_title: str
    trained_band: tuple[float, float] | None
    warm_up: int
    tones: Tones
    truth: Truth | None
    ready: Ready | None = None
    working: Working | None = None
    failed: Failed | None = None
    trouble: str = ""
    values: Mapping[str, float] | None = None
    """Of the current frame, by measure; `None` while they are not known."""

    @property
    def name(self) -> str:
        """A, B, C or D."""
        return NAMES[self.number]

    @property
    def colour(self) -> str:
        """Its hue in curves and marks."""
        return COLOURS[self.number]

    @property
    def is_there(self) -> bool:
        """Whether the current frame is the one that is wanted, and final."""
        ready, request = self.ready, self.request
        return (
            ready is not None
            and request is not None
            and ready.request.frame == request.frame
            and not ready.is_approximate
        )

    @property
    def words(self) -> str:
        """What it is, in one line."""
        return " · ".join((self.model_title, *self.settings))

    @property
    def settings(self) -> tuple[str, ...]:
        """How it differs from its network's plain run between any frames, in words."""
        if self.request is None:
            return ()
        parts = []
        if self.ready is not None and self.request.precision != "fp32":
            parts.append(self.ready.contract.runtime.precision)
        parts.append("protocol’s windows" if self.run.replays else policy(self.request.policy))
        if not self.request.is_original:
            parts.append("changed inside")
        if not self.request.cleaning.changes_nothing:
            parts.append(cleaning_words(self.request.cleaning))
        return tuple(parts)

    def events_per_pixel(self, num_pixels: int) -> float | None:
        """How dense its window is."""
        return None if self.window is None else self.window.num_events / num_pixels

    @property
    def state_words(self) -> str:
        """How much its recurrent state has seen, and whether the recording is too short for it to be called warm."""
        seen, needed = (0 if self.request is None else self.request.index), self.warm_up
        if self.ready is not None and self.ready.request == self.request and self.ready.warm_up:
            seen, needed = self.ready.num_seen, self.ready.warm_up
        if seen >= needed:
            return "state warm"
        return f"warm-up {seen} of {needed}" if needed < self.num_windows else "not warm in this recording"

    def with_values(self, values: Mapping[str, float] | None) -> RunShown:
        """The same, with what was measured."""
        return replace(self, values=values)


def runs_of(page: Page) -> tuple[RunShown, ...]:
    """All runs of a page, the main one first, with the camera frame that each is held against."""
    offset = page.state.of(CompareState).offset
    return tuple(_shown(page, frame, offset) for frame in page.runs)


def _shown(page: Page, frame: RunFrame, offset: int) -> RunShown:
    model = frame.model
    truth = None if page.moment is None else truth_of(page.moment, frame.window, offset)
    return RunShown(
        frame.number,
        frame.run,
        frame.request,
        frame.window,
        frame.num_windows,
        model.title,
        model.trained_band,
        frame.warm_up,
        tones_in(page.state, model.is_linear_light),
        truth,
        frame.ready,
        frame.working,
        frame.failed,
        frame.trouble,
    )


def truth_of(moment: Moment, window: Window | None, offset: int) -> Truth | None:
    """The camera frame nearest to a window's end, its clock shifted by `offset` µs."""
    source = moment.recording.ground_truth
    if source is None or len(source) == 0 or window is None:
        return None
    index = source.nearest(window.t_stop - offset)
    stamp = int(source.stamps[index])
    return Truth(index, stamp + offset - window.t_stop, stamp)


def cleaning_words(cleaning: Cleaning) -> str:
    """What is taken out."""
    parts = ["hot pixels"] if cleaning.hot_pixels else []
    if cleaning.support_within:
        if cleaning.neighbours > 1:
            return f"without {cleaning.text}"
        parts.append(f"what no neighbour supports within {milliseconds(cleaning.support_within / 1000)}")
    return f"without {' and '.join(parts)}" if parts else "events as recorded"


def truth_frame(moment: Moment, truth: Truth | None) -> Float32[np.ndarray, "h w"] | None:
    """The camera's frame as the metrics see it, if it has the sensor's size."""
    source = moment.recording.ground_truth
    if truth is None or source is None:
        return None
    key = ("truth", moment.recording_id, truth.stamp)
    frame = ARRAYS.get(key, lambda: source.read_frame(truth.index), lambda made: made.nbytes)
    size = (moment.recording.sensor.height, moment.recording.sensor.width)
    return frame if frame.shape == size else None
