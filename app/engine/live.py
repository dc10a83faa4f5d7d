"""The engine's live side: when a window is full, it is cut and the network steps through it at once.

A window is cut when the network gets to it, so that what waited meanwhile becomes one window and nothing queues up.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable
from threading import Event, Thread
from typing import TYPE_CHECKING

from app.catalogue.live import LiveFeed
from app.engine.playbacks import LoadedPlayback, PlaybackCache
from app.engine.queue import RequestQueue
from app.engine.requests import FrameRequest, Precision
from etnet.errors import EtnetError

if TYPE_CHECKING:
    from etnet.playback.playback import Step

MEASURED = 0.5
"""Seconds of events over which the rate is measured before windows are chosen."""
SLOW, MOST_MEASURED = 0.25, 3
"""Seconds of a step above which it is measured again, and how often in all."""
NEAR = 3
"""A visitor whose window is among the last few follows the source."""
_WAKE = 0.01

_log = logging.getLogger(__name__)
Done = Callable[[LoadedPlayback, FrameRequest, "Step", float], None]
"""Told the step of a window and when (`time.perf_counter`) it began."""


class LiveSteps:
    """Used by the engine's thread, but for `has_work`. `model_id` and `precision` go on while nobody looks."""

    def __init__(
        self, feed: LiveFeed, model_id: str, precision: Precision, playbacks: PlaybackCache, book: RequestQueue
    ) -> None:
        self._feed, self._playbacks, self._book = feed, playbacks, book
        self._model_id = model_id
        self._precision: Precision = precision
        self._step_seconds: float | None = None
        self._num_measured = 0
        self._failed: tuple[str, Precision] | None = None
        self._stopped = Event()
        Thread(target=self._watch, daemon=True, name="live windows").start()

    def stop(self) -> None:
        """End the thread that watches the source."""
        self._stopped.set()

    def has_work(self) -> bool:
        """Whether a window is full, or the windows can be chosen now. Safe from every thread."""
        if self._failed == (self._model_id, self._precision):
            return False
        if self._feed.windows is not None:
            return self._feed.windows.is_full()
        return self._is_to_measure() or self._rate() is not None

    def _is_to_measure(self) -> bool:
        """A step that seems slow is measured again: a machine is busy while a viewer starts."""
        is_slow = self._step_seconds is None or self._step_seconds > SLOW
        return is_slow and self._num_measured < MOST_MEASURED

    def work(self, done: Done) -> None:
        """One window, or one part of the preparation."""
        try:
            self._work(done)
        except EtnetError as error:
            self._feed.live.note(str(error))
            self._failed = self._model_id, self._precision
        except Exception as error:
            _log.exception("a live step failed")
            self._feed.live.note(f"the network could not go on ({type(error).__name__}: {error})")
            self._failed = self._model_id, self._precision

    def _work(self, done: Done) -> None:
        if self._feed.windows is None:
            self._prepare()
            return
        wants_attention = self._choose_lead(len(self._feed.windows.kept))
        window = self._feed.windows.take(timeout=0)
        if window is None:
            return
        began = time.perf_counter()
        policy = self._feed.windows.policy
        request = FrameRequest(self._feed.id, self._model_id, self._precision, policy, window.index, wants_attention)
        loaded = self._playbacks.reaching(request)
        step = loaded.playback.at(window.index, _probe() if wants_attention else None)
        if step.attention is not None:
            self._playbacks.keep_attention(request, step.attention)
        done(loaded, request, step, began)
        self._feed.finished(window.index)

    def _choose_lead(self, num_windows: int) -> bool:
        """Step the network that somebody looks at; whether somebody wants the newest window's attention."""
        watched = [
            turn.request for turn in self._book.last_turns()
            if turn.request.recording_id == self._feed.id and turn.request.cleaning.changes_nothing
        ]  # fmt: skip
        led = {(request.model_id, request.precision) for request in watched}
        if watched and (self._model_id, self._precision) not in led:
            self._model_id, self._precision = watched[0].model_id, watched[0].precision
        return any(
            request.wants_attention and request.is_original and request.index >= num_windows - NEAR
            for request in watched
            if (request.model_id, request.precision) == (self._model_id, self._precision)
        )

    def _prepare(self) -> None:
        """Measure a step first, then the source's rate; both together say which windows fit."""
        from etnet.live.pace import fitting_policy, measured_step

        if self._is_to_measure():
            self._playbacks.start()
            model, _ = self._playbacks.model(self._model_id, self._precision)
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
