"""The engine: one thread runs the model for all visitors. Nobody waits for it; it calls when something is there."""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np

from app.catalogue.live import LiveFeed
from app.catalogue.threads import THREADS
from app.engine.failures import in_words
from app.engine.gentle_import import COMING, GentleImport
from app.engine.jobs import Job, JobQueue, Tell
from app.engine.kept_frames import KeptFrames, KeptRanges, show_kept
from app.engine.live import LiveSteps
from app.engine.playbacks import Library, LoadedPlayback, Loader, PlaybackCache, nowhere
from app.engine.prefetch import Prefetcher
from app.engine.published import PlaybackCached, Published, RecentFrames, Thumbnails
from app.engine.queue import SHORT, Deliver, PendingRequest, RequestQueue
from app.engine.replies import array_of, cold_frame, hand_over, ready_of
from app.engine.requests import EngineStatus, Failed, FrameRequest, Precision, Ready, Reply, Working
from etnet.errors import Cancelled, RecordingError, WindowError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from jaxtyping import Float32

    from etnet.events.recording import Recording
    from etnet.playback.disk_cache import DiskCache
    from etnet.playback.playback import Step

QUANTUM = 0.4
"""Seconds of work on one visitor's request after which others get their turn; doubles with each of its turns."""
PATIENCE = 1_000.0
"""A seek that will take longer (ms) shows an approximate frame first."""
SLOW_STEP = 2_000.0
"""A step expected to take longer (ms) is announced before the first one."""
PAUSE = 1.0
"""Seconds for which the thread rests after work that failed, unless something new is asked: it may fail again."""

_log = logging.getLogger(__name__)


class Engine:
    """Serves requests: the newest of each visitor, in turn. `deliver` runs on the engine's thread and must be quick."""

    def __init__(
        self,
        library: Library,
        budget_bytes: int,
        threads: int | None = None,
        device: str = "cpu",
        load: Loader | None = None,
        prefetches: bool = True,
        live: tuple[LiveFeed, str, Precision] | None = None,
        longest_step: float | None = None,
        disk: DiskCache | None = None,
        keeps: Callable[[str], bool] = bool,
        tunes: bool = False,
    ) -> None:
        """`live`: a source with the network that follows it, whether anybody looks or not. `disk` keeps frames of those
        recordings of which `keeps` says so (by id) for the next start. `longest_step`: one that takes longer (ms) is
        not begun, for nothing can stop it or go beside it.
        """
        self._kept = None if disk is None else KeptFrames(library, disk, keeps, device, threads)
        self._gentle: GentleImport | None = GentleImport(COMING)
        disk_for = nowhere if self._kept is None else self._kept.disk_for
        about = library, budget_bytes, device, threads, load, disk_for, tunes, longest_step
        self._playbacks = PlaybackCache(*about, self._note_made)
        self.cleaned = self._playbacks.cleaned
        self._book = RequestQueue()
        self._jobs = JobQueue(self._playbacks, self._book.changed)
        self._prefetcher = Prefetcher(self._playbacks, self._book) if prefetches else None
        self._live = None if live is None else LiveSteps(*live, self._playbacks, self._book)
        self._live_had_its_turn = False
        self._to_prepare: tuple[str, str] | None = None
        self._to_forget: list[str] = []
        self._recent, self._thumbnails = RecentFrames(), Thumbnails()
        self._is_stopping = self._is_loading = False
        self._published = Published()
        self._thread = Thread(target=self._run, daemon=True, name="engine")
        self._thread.start()

    # What other threads may call; none of it waits for the model.

    def request(self, visitor: str, request: FrameRequest, deliver: Deliver) -> None:
        """Ask for something; the visitor's former request, if it is not granted yet, is dropped.

        A frame that was given lately is delivered at once, on the caller's thread: it need not wait for a step.
        """
        if (gentle := self._gentle) is not None:
            gentle.page_asks()
        kept, is_loaded = self._kept, self._published.pace(request) is not None
        at_hand = self._recent.find(request) or (None if kept is None else kept.find(request))
        turn = self._book.put(visitor, request, deliver, is_shown=at_hand is not None)
        if at_hand is None:
            if kept is not None and not kept.is_named(request):
                THREADS.start(lambda: show_kept(kept, self._book, turn), "frames on disk")
            return
        if is_loaded:  # before that nobody knows whether what an earlier run kept is what this one makes
            self._recent.keep(at_hand)
        hand_over(turn, at_hand)
        if is_loaded and not request.wants_attention:
            self._book.settle(turn)

    def expect(self) -> None:
        """A visitor has come: their page is drawn before the network's code is imported further."""
        if (gentle := self._gentle) is not None:
            gentle.page_begins()

    def drop(self, visitor: str) -> None:
        """Forget a visitor who has left; work for them ends after the step that runs."""
        self._book.drop(visitor)
        self._jobs.drop(visitor)

    def job(self, visitor: str, slot: str, job: Job, tell: Tell) -> None:
        """Ask a longer question, answered bit by bit while nobody waits; it replaces the slot's former one."""
        self._jobs.put(visitor, slot, job, tell)

    def drop_job(self, visitor: str, slot: str) -> None:
        """The answer in this slot is not wanted any more."""
        self._jobs.drop(visitor, slot)

    def prepare(self, model_id: str, precision: str) -> None:
        """Load a model as soon as nobody waits, so that the first request finds it."""
        with self._book.changed:
            self._to_prepare = (model_id, precision)
            self._book.changed.notify_all()

    def forget(self, recording_id: str, recordings: Sequence[Recording] = ()) -> None:
        """Forget everything that was computed of a recording, after the step that runs; `recordings` are closed now."""
        for recording in recordings:
            self.cleaned.forget(recording)
        with self._book.changed:
            self._to_forget.append(recording_id)
            self._book.changed.notify_all()

    def stop(self, patience: float = 2.0) -> None:
        """End the thread after the step that runs, and wait for that as long as `patience` (s)."""
        with self._book.changed:
            self._is_stopping = True
            if self._live is not None:
                self._live.stop()
            self._book.changed.notify_all()
        self._thread.join(patience)

    def cached(self, request: FrameRequest) -> PlaybackCached | KeptRanges | None:
        """What is held of the original's frames and states, exact for no request that changes it; `None` before any."""
        found = self._published.cached(request) or (None if self._kept is None else self._kept.ranges(request))
        return found if found is None or request.is_original else replace(found, is_exact=False)

    def thumbnail(self, request: FrameRequest) -> Float32[np.ndarray, "h w"] | None:
        """A small copy of a request's exact frame, if it was computed lately."""
        return self._thumbnails.find(request)

    def status(self, request: FrameRequest) -> EngineStatus:
        """How the engine fares with requests like this one."""
        pace, precision = self._published.pace(request), self._published.precision(request)
        return EngineStatus(self._is_loading, pace.step if pace else None, precision, self._book.num_waiting)

    # What runs on the engine's thread.

    def _run(self) -> None:
        """Work until the end. A piece that fails is given up, and after a pause the others' go on."""
        said = ""
        while not self._is_stopping:
            try:
                with self._book.changed:
                    while not (self._is_stopping or self._has_work()):
                        self._book.changed.wait()
                if not self._is_stopping:
                    self._work()
            except Exception as error:
                if repr(error) != said:
                    _log.exception("the engine gave up a piece of work")
                said = repr(error)
                with self._book.changed:
                    self._book.changed.wait(PAUSE)

    def _work(self) -> None:
        """One piece of work; while the thread rests it refers to no visitor, who may have left."""
        while self._to_forget:
            self._forget_recording(self._to_forget.pop())
        # Live windows and all others take turns: neither waits for more than a stretch of the other's work.
        if self._live is not None and not self._live_had_its_turn and self._live.has_work():
            self._live_had_its_turn = True
            self._live.work(self._stepped)
            return
        self._live_had_its_turn = False
        turn = None if self._jobs.is_owed else self._book.next_turn()
        if turn is not None:
            self._serve(turn)
            self._jobs.note_granted()
        elif self._to_prepare is not None:
            self._prepare_model()
        elif self._jobs.num_waiting:
            self._jobs.work(self._is_wanted_elsewhere)
        elif self._prefetcher is not None and not self._live_waits() and self._prefetcher.has_work():
            self._prefetcher.work(self._is_wanted_elsewhere, self._note_prepared)
        else:
            self._playbacks.try_kernels()

    def _has_work(self) -> bool:
        prefetches = self._prefetcher is not None and self._prefetcher.has_work()
        waits = self._to_forget or self._to_prepare or self._live_waits() or self._playbacks.has_untried
        return bool(self._book.num_waiting or waits or self._jobs.num_waiting or prefetches)

    def _live_waits(self) -> bool:
        return self._live is not None and self._live.has_work()

    def _stepped(self, loaded: LoadedPlayback, request: FrameRequest, step: Step, began: float) -> None:
        """A live window's frame is at hand for all who ask for it."""
        loaded.wait()
        loaded.pace.note_whole((time.perf_counter() - began) * 1000)
        loaded.state_bytes = step.state.nbytes
        self._recent.keep(ready_of(loaded, request, step.frame, None, began))
        self._published.tell(request, loaded, at_once=False)

    def _serve(self, turn: PendingRequest) -> None:
        try:
            self._grant(turn)
        except Cancelled:
            return  # replaced by a newer request, dropped, or another visitor's turn: it stays in the book if wanted
        except Exception as error:
            self._finish(turn, Failed(turn.request, in_words(error, turn.request)))

    def _grant(self, turn: PendingRequest) -> None:
        request, began = turn.request, time.perf_counter()
        loaded = self._load(turn)
        if not 0 <= request.index < len(loaded.windows):
            raise WindowError(f"window {request.index} does not exist; this plan has {len(loaded.windows)}")
        playback, intervention = loaded.playing(request)
        attention = self._playbacks.attention(request) if request.wants_attention else None
        frame = playback.frame(request.index, intervention)
        if frame is not None:
            ready = ready_of(loaded, request, frame, attention, began)
            if attention is not None or not request.wants_attention:
                self._finish(turn, ready)
                return
            if not turn.is_shown:
                self._say(turn, ready)
        elif turn.num_turns == 1 and loaded.reaches(request.index):
            self._preview(turn, loaded)
        try:
            self._compute(turn, loaded, began)
        except RecordingError:
            if loaded.reaches(request.index):
                raise
            # Events on the way have left a live recording's buffer while it was replayed.
            self._compute(turn, self._playbacks.reaching(request), began)

    def _compute(self, turn: PendingRequest, loaded: LoadedPlayback, began: float) -> None:
        request = turn.request
        if not loaded.reaches(request.index):
            self._finish(turn, cold_frame(loaded, request, began, lambda: self._must_yield(turn)))
            return
        step = self._exact_step(turn, loaded)
        if step.attention is not None:
            self._playbacks.keep_attention(request, step.attention)
        self._finish(turn, ready_of(loaded, request, step.frame, step.attention, began))

    def _load(self, turn: PendingRequest) -> LoadedPlayback:
        request = turn.request
        loaded = self._playbacks.held(request)
        if loaded is None:
            loads = not self._playbacks.has_model(request)
            what = "loading the network" if loads else "opening the recording"
            self._say(turn, Working(request, 0, 0, what))
            self._is_loading = loads
            try:
                self._import_network()
                loaded = self._playbacks.loaded(request)
            finally:
                self._is_loading = False
            if loaded.expected_step > SLOW_STEP:
                size, seconds = loaded.playback.recording.sensor, loaded.expected_step / 1000
                self._say(turn, Working(request, 0, 0, f"an image of {size} takes about {seconds:.0f} s here"))
        return self._playbacks.reaching(request)

    def _note_made(self, request: FrameRequest, loaded: LoadedPlayback) -> None:
        """A playback is there, whether for a request, a job or a live window."""
        if self._kept is not None:
            self._kept.learn(request, loaded)
        self._recent.keep_contract(request.playback, loaded.contract)
        self._note_precision(request.model_id, request.precision)
        self._published.tell_pace(request, loaded)
        self._published.keep_only(self._playbacks.held_keys())

    def _forget_recording(self, recording_id: str) -> None:
        self._playbacks.forget(recording_id)
        self._jobs.forget(recording_id)
        self._recent.forget(recording_id)
        self._thumbnails.forget(recording_id)
        if self._kept is not None:
            self._kept.forget(recording_id)
        self._published.keep_only(self._playbacks.held_keys())

    def _preview(self, turn: PendingRequest, loaded: LoadedPlayback) -> None:
        """Show an approximate frame before a long seek."""
        request = turn.request
        num_replayed = loaded.playback.plan(request.index).num_replayed
        is_long = loaded.pace.seek(num_replayed) > PATIENCE and num_replayed > 2 * loaded.warm_up
        if not is_long or not request.is_original:
            return
        began = time.perf_counter()
        step = loaded.playback.approximate(request.index, loaded.warm_up, lambda: self._is_stale(turn))
        self._say(turn, ready_of(loaded, request, step.frame, None, began, is_approximate=True))

    def _exact_step(self, turn: PendingRequest, loaded: LoadedPlayback):
        from etnet.nets.attention import AttentionProbe

        request = turn.request
        playback, intervention = loaded.playing(request)
        num_replayed = playback.plan(request.index).num_replayed
        is_short = loaded.pace.step is not None and loaded.pace.seek(num_replayed) <= SHORT
        clock = [time.perf_counter()]
        encodes: list[float] = []

        def progress(done: int, total: int) -> None:
            loaded.wait()
            now = time.perf_counter()
            encodes.append((now - clock[0]) * 1000)
            clock[0] = now
            if total > 1:
                self._say(turn, Working(request, done, total, "replaying"))
            self._published.tell(request, loaded, at_once=False)

        try:
            probe = AttentionProbe() if request.wants_attention else None
            step = playback.at(request.index, probe, intervention, lambda: self._must_yield(turn, is_short), progress)
        finally:
            loaded.pace.note(float(np.median(encodes)) if encodes else None, None)
            self._published.tell(request, loaded)
        loaded.wait()
        loaded.pace.note(None, (time.perf_counter() - clock[0]) * 1000)
        loaded.state_bytes = step.state.nbytes
        return step

    def _is_stale(self, turn: PendingRequest) -> bool:
        return self._is_stopping or not self._book.is_wanted(turn)

    def _must_yield(self, turn: PendingRequest, is_short: bool = False) -> bool:
        """Asked between steps: nobody wants this, or others have waited long enough. What was laid is kept."""
        if self._is_stale(turn):
            return self._is_stopping or not is_short or not self._book.goes_without(turn)
        is_long = time.monotonic() - turn.began > QUANTUM * 2 ** (turn.num_turns - 1)
        return is_long and (self._book.others_wait(turn) or self._live_waits())

    def _finish(self, turn: PendingRequest, reply: Reply) -> None:
        if isinstance(reply, Ready):
            self._recent.keep(reply)
            if not reply.is_approximate:
                self._thumbnails.keep(reply.request, reply.frame)
        if self._book.settle(turn) or (isinstance(reply, Ready) and self._book.settle_late(turn)):
            hand_over(turn, reply)

    def _say(self, turn: PendingRequest, reply: Reply) -> None:
        is_done = turn.is_shown and not turn.request.wants_attention and isinstance(reply, Working)
        if self._book.is_wanted(turn) and not is_done:
            hand_over(turn, reply)

    # While nobody waits.

    def _note_prepared(self, request: FrameRequest, loaded: LoadedPlayback) -> None:
        """Publish what was prepared; `request` is that of the window."""
        self._published.tell(request, loaded)
        frame = loaded.playback.frame(request.index)
        if frame is not None:
            self._thumbnails.keep(request.plain, array_of(frame))

    def _prepare_model(self) -> None:
        assert self._to_prepare is not None
        (model_id, precision), self._to_prepare = self._to_prepare, None
        self._is_loading = True
        try:
            self._import_network()
            self._note_precision(model_id, precision)
        except Exception:
            _log.info("preparing %s failed; the first request will say why", model_id, exc_info=True)
        finally:
            self._is_loading = False

    def _import_network(self) -> None:
        """Import torch, and set it up; nothing is left to be gentle with after that."""
        if self._gentle is not None:
            self._gentle.import_network()
            self._gentle = None
        self._playbacks.start()

    def _note_precision(self, model_id: str, precision: str) -> None:
        self._published.tell_precision(model_id, precision, self._playbacks.model(model_id, precision)[0])

    def _is_wanted_elsewhere(self) -> bool:
        return self._is_stopping or self._book.num_waiting > 0
