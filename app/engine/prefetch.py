"""What the engine does while nobody waits: lay states and frames ahead of every visitor's last request."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal

from app.engine.playbacks import LoadedPlayback, PlaybackCache
from app.engine.queue import LONGEST_STRIDE, PendingRequest, RequestQueue
from app.engine.requests import FrameRequest
from etnet.errors import Cancelled

NEAR, FRAMES_AHEAD, STATES_AHEAD = 8, 24, 64
"""Windows that are prepared: states close by, frames, states further on."""

Task = tuple[Literal["state", "frame"], int]

_log = logging.getLogger(__name__)


class Prefetcher:
    """Keeps, for each visitor, what is still to be prepared. Used by the engine's thread alone."""

    def __init__(self, playbacks: PlaybackCache, book: RequestQueue) -> None:
        self._playbacks = playbacks
        self._book = book
        self._plans: dict[str, tuple[PendingRequest, Iterator[Task] | None]] = {}
        self._last: dict[str, FrameRequest] = {}
        self._seen = (-1, -1)

    def has_work(self) -> bool:
        """Whether some visitor's next windows are not prepared."""
        seen = self._book.version, self._playbacks.version
        if seen != self._seen:
            self._seen = seen
            self._plan()
        return any(tasks is not None for _, tasks in self._plans.values())

    def _plan(self) -> None:
        """What comes next for every visitor; the plans of old requests are forgotten."""
        turns = {turn.visitor: turn for turn in self._book.last_turns()}
        self._plans = {name: plan for name, plan in self._plans.items() if turns.get(name) is plan[0]}
        self._last = {name: request for name, request in self._last.items() if name in turns}
        for visitor, turn in turns.items():
            loaded = self._playbacks.held(turn.request)
            if visitor not in self._plans and loaded is not None and turn.request.is_original:
                stride = _stride(self._last.get(visitor), turn.request)
                tasks = windows_ahead(turn.request.index, len(loaded.windows), loaded.num_states, stride)
                self._plans[visitor] = (turn, tasks)
                self._last[visitor] = turn.request

    def work(self, cancelled: Callable[[], bool], report: Callable[[FrameRequest, LoadedPlayback], None]) -> None:
        """One task, for the first visitor who has any left. No task of a request is tried twice, so this ends."""
        for visitor, (turn, tasks) in self._plans.items():
            loaded = self._playbacks.held(turn.request)
            task = next(tasks, None) if tasks is not None and loaded is not None else None
            if task is None or loaded is None:
                self._plans[visitor] = (turn, None)
                continue
            try:
                _do(task, loaded, cancelled)
                report(replace(turn.request, index=task[1]), loaded)
            except Cancelled:
                pass
            except Exception:
                _log.info("preparing window %d failed; a request for it will say why", task[1], exc_info=True)
                self._plans[visitor] = (turn, None)
            return


def windows_ahead(index: int, num_windows: int, num_states: int, stride: int = 0) -> Iterator[Task]:
    """What to prepare after window `index`, in order.

    For a visitor who goes on by `stride` windows at a time, as playing does, frames in that order. For all others near
    states first (a seek there then costs one decode), near frames, then states further on; never more states than half
    of what fits (`num_states`), so that those around the visitor stay.
    """
    last = num_windows - 1
    if stride:
        for ahead in range(index + stride, last + 1, stride)[:FRAMES_AHEAD]:
            yield "frame", ahead
    room = min(STATES_AHEAD, num_states // 2)
    for ahead in range(1, min(NEAR, room, last - index) + 1):
        yield "state", index + ahead
    for ahead in range(1, min(FRAMES_AHEAD, last - index) + 1):
        yield "frame", index + ahead
    for ahead in range(FRAMES_AHEAD + 1, min(room, last - index) + 1):
        yield "state", index + ahead


def _stride(before: FrameRequest | None, now: FrameRequest) -> int:
    """By how many windows a visitor goes on; 0 for one who does not go on in steps."""
    if before is None or before.playback != now.playback:
        return 0
    return now.index - before.index if 0 < now.index - before.index <= LONGEST_STRIDE else 0


def _do(task: Task, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> None:
    kind, index = task
    if kind == "state":
        loaded.playback.lay_state(index, cancelled)
    elif not loaded.playback.has_frame(index):
        is_one_step = loaded.playback.plan(index).num_replayed == 1
        began = time.perf_counter()
        loaded.playback.at(index, cancelled=cancelled)
        if is_one_step:
            loaded.wait()
            loaded.pace.note_whole((time.perf_counter() - began) * 1000)
