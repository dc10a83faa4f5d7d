"""The engine's live side: when a window is full, it is cut and the network steps through it at once.

A window is cut when the network gets to it, so that what waited meanwhile becomes one window and nothing queues up.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event, Thread
from typing import TYPE_CHECKING

from app.catalogue.live import LiveFeed
from app.engine.playbacks import LoadedPlayback, PlaybackCache
from app.engine.queue import RequestQueue
from app.engine.requests import FrameRequest, Precision
from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.windows import Window

if TYPE_CHECKING:
    from etnet.playback.playback import Step

MEASURED = 0.5
"""Seconds of events over which the rate is measured before windows are chosen."""
SLOW, MOST_MEASURED = 0.25, 3
"""Seconds of a step above which it is measured again, and how often in all."""
RESTS = 10.0
"""Seconds for which a network that could not go on is left alone; another one is stepped meanwhile."""
STRETCH = 0.4
"""Seconds after which a network on its way to the newest window makes way for who waits."""
NEAR_STARTS = 1.0, 0.25, 0.0
"""How long before a window, as shares of the warm-up, a network that was overtaken on its way to it begins, one try
after the other: the window itself can be read in any case."""
NEAR = 3
"""A visitor whose window is among the last few follows the source."""
_WAKE = 0.01

_log = logging.getLogger(__name__)
Network = tuple[str, Precision]
Done = Callable[[LoadedPlayback, FrameRequest, "Step", float], None]
"""Told the step of a window and when (`time.perf_counter`) it began."""


@dataclass(slots=True)
class _Way:
    """How a network comes to a window that was taken."""

    window: Window
    interrupted: LoadedPlayback | None = None
    """On its way when it made way for others."""
    num_near: int = 0
    """Cold starts near the window, each nearer than the one before."""


class LiveSteps:
    """Used by the engine's thread, but for `has_work`. `model_id` and `precision` go on while nobody looks."""

    def __init__(
        self, feed: LiveFeed, model_id: str, precision: Precision, playbacks: PlaybackCache, book: RequestQueue
    ) -> None:
        self._feed, self._playbacks, self._book = feed, playbacks, book
        self._home: Network = (model_id, precision)
        self._led = self._home
        self._step_seconds: float | None = None
        self._num_measured = 0
        self._resting: dict[Network, float] = {}
        self._begun: _Way | None = None
        """To a window that was taken and that the network has not come to yet."""
        self._stopped = Event()
        Thread(target=self._watch, daemon=True, name="live windows").start()

    def stop(self) -> None:
        """End the thread that watches the source."""
        self._stopped.set()

    def has_work(self) -> bool:
        """Whether a window is full, or the windows can be chosen now. Safe from every thread."""
        if self._lead() is None:
            return False
        if self._feed.windows is not None:
            return self._begun is not None or self._feed.windows.is_full()
        return self._is_to_measure() or self._rate() is not None

    def _is_to_measure(self) -> bool:
        """A step that seems slow is measured again: a machine is busy while a viewer starts."""
        step = self._step_seconds
        return step is None or (step > SLOW and self._num_measured < MOST_MEASURED)

    def work(self, done: Done) -> None:
        """One window or a stretch of the way to it, or one part of the preparation."""
        led = self._lead()
        if led is None:
            return
        if led != self._led and self._begun is not None:
            self._begun = _Way(self._begun.window)
        self._led = led
        try:
            self._work(done)
        except Cancelled:
            return  # others wait; it goes on from the states that were laid
        except EtnetError as error:
            self._feed.live.note(str(error))
        except Exception as error:
            _log.exception("a live step failed")
            self._feed.live.note(f"the network could not go on ({type(error).__name__}: {error})")
        else:
            return
        self._begun = None
        self._resting = {**self._resting, led: time.monotonic() + RESTS}

    def _work(self, done: Done) -> None:
        if self._feed.windows is None:
            self._prepare()
            return
        wants_attention = self._wants_attention(len(self._feed.windows.kept))
        if self._begun is None and (taken := self._feed.windows.take(timeout=0)) is not None:
            self._begun = _Way(taken)
        way = self._begun
        if way is None:
            return
        window = way.window
        began = time.perf_counter()
        policy = self._feed.windows.policy
        request = FrameRequest(self._feed.id, *self._led, policy, window.index, wants_attention)
        loaded, step = self._step(request, way)
        if step.attention is not None:
            self._playbacks.keep_attention(request, step.attention)
        done(loaded, request, step, began)
        self._feed.finished(window.index)
        self._begun = None

    def _step(self, request: FrameRequest, way: _Way) -> tuple[LoadedPlayback, Step]:
        """The step of a request's window; from a cold start near it where events on the way left the buffer meanwhile,
        as they do when a network is slower than the source: it would not catch up from the oldest window."""
        loaded, former = self._playbacks.loaded(request), way.interrupted
        # One that others' requests have made anew meanwhile was overtaken as well.
        if former is None or (loaded is former and loaded.reaches(request.index)):
            loaded = self._playbacks.reaching(request)
            try:
                return loaded, self._at(request, loaded, way)
            except RecordingError:
                if loaded.reaches(request.index):
                    raise
        return self._near(request, way)

    def _near(self, request: FrameRequest, way: _Way) -> tuple[LoadedPlayback, Step]:
        """The step from a cold start near the window; nearer still where events on that way, too, have left."""
        while True:
            share = NEAR_STARTS[min(way.num_near, len(NEAR_STARTS) - 1)]
            way.num_near += 1
            loaded = self._playbacks.anew(request)
            loaded.playback.first = max(loaded.playback.first, request.index - int(share * loaded.warm_up))
            try:
                return loaded, self._at(request, loaded, way)
            except RecordingError:
                if loaded.playback.first >= request.index or loaded.reaches(request.index):
                    raise

    def _at(self, request: FrameRequest, loaded: LoadedPlayback, way: _Way) -> Step:
        ends = time.monotonic() + STRETCH

        def makes_way() -> bool:
            return self._stopped.is_set() or (time.monotonic() > ends and self._book.num_waiting > 0)

        probe = _probe() if request.wants_attention else None
        try:
            return loaded.playback.at(request.index, probe, cancelled=makes_way)
        except Cancelled:
            way.interrupted = loaded
            raise

    def _lead(self) -> Network | None:
        """The network to step: the one that is stepped while somebody looks at it, else one that somebody looks at.

        Where all of these rest the source goes on with the one it began with; `None` where that rests, too.
        """
        watched: list[Network] = [(request.model_id, request.precision) for request in self._watched()]
        wished = [self._led] if self._led in watched or not watched else []
        now = time.monotonic()
        return next((each for each in (*wished, *watched, self._home) if now >= self._resting.get(each, 0.0)), None)

    def _watched(self) -> list[FrameRequest]:
        """What is asked of the source, by who was served last first."""
        return [
            turn.request for turn in self._book.last_turns()
            if turn.request.recording_id == self._feed.id and turn.request.cleaning.changes_nothing
        ]  # fmt: skip

    def _wants_attention(self, num_windows: int) -> bool:
        """Whether somebody wants the newest window's attention."""
        return any(
            request.wants_attention and request.is_original and request.index >= num_windows - NEAR
            for request in self._watched()
            if (request.model_id, request.precision) == self._led
        )

    def _prepare(self) -> None:
        """Measure a step first, then the source's rate; both together say which windows fit."""
        from etnet.live.pace import fitting_policy, measured_step

        if self._is_to_measure():
            self._playbacks.start()
            model, _ = self._playbacks.model(*self._led)
            self._num_measured += 1
            self._step_seconds = min(measured_step(model, self._feed.seen), self._step_seconds or math.inf)
            return
        rate = self._rate()
        if rate is not None and self._step_seconds is not None:
            pace = fitting_policy(self._step_seconds, rate, self._feed.seen)
            self._feed.cut_by(pace.policy, pace.said)

    def _rate(self) -> float | None:
        """Events a second; `None` while too few came to tell."""
        extent = self._feed.live.extent()
        if extent.first_stamp is None or extent.until is None:
            return None
        seconds = (extent.until - extent.first_stamp) / 1e6
        is_enough = seconds >= MEASURED or self._feed.live.is_over
        return extent.num_events / max(seconds, 1e-6) if is_enough else None

    def _watch(self) -> None:
        """Wake the engine when there is something to do for the source."""
        changed = self._feed.live.buffer.changed
        while not self._stopped.is_set():
            with changed:
                changed.wait(0.2)
            if self.has_work():
                with self._book.changed:
                    self._book.changed.notify_all()
            self._stopped.wait(_WAKE)


def _probe():
    from etnet.nets.attention import AttentionProbe

    return AttentionProbe()
