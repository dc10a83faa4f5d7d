"""What the engine does while nobody waits: lay states and frames ahead of every visitor's last wish."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Literal

from app.studio import Stage, Studio
from app.wishbook import Turn, WishBook
from app.wishes import Wish
from etnet.errors import Cancelled

NEAR, FRAMES_AHEAD, STATES_AHEAD = 8, 24, 64
"""Windows that are prepared: states close by, frames, states further on."""

Job = tuple[Literal["state", "frame"], int]

_log = logging.getLogger(__name__)


class Prefetcher:
    """Keeps, for each visitor, what is still to be prepared. Used by the engine's thread alone."""

    def __init__(self, studio: Studio, book: WishBook) -> None:
        self._studio = studio
        self._book = book
        self._plans: dict[str, tuple[Turn, Iterator[Job] | None]] = {}

    def has_work(self) -> bool:
        """Whether some visitor's next windows are not prepared; forgets the plans of old wishes."""
        turns = {turn.visitor: turn for turn in self._book.last_turns()}
        self._plans = {name: plan for name, plan in self._plans.items() if turns.get(name) is plan[0]}
        for visitor, turn in turns.items():
            stage = self._studio.held_stage(turn.wish)
            if visitor not in self._plans and stage is not None and turn.wish.is_original:
                jobs = windows_ahead(turn.wish.index, len(stage.windows), stage.num_states)
                self._plans[visitor] = (turn, jobs)
        return any(jobs is not None for _, jobs in self._plans.values())

    def work(self, cancelled: Callable[[], bool], report: Callable[[Wish, Stage], None]) -> None:
        """One job, for the first visitor who has any left. No job of a wish is tried twice, so this ends."""
        for visitor, (turn, jobs) in self._plans.items():
            stage = self._studio.held_stage(turn.wish)
            job = next(jobs, None) if jobs is not None and stage is not None else None
            if job is None or stage is None:
                self._plans[visitor] = (turn, None)
                continue
            try:
                _do(job, stage, cancelled)
                report(turn.wish, stage)
            except Cancelled:
                pass
            except Exception:
                _log.info("preparing window %d failed; a wish for it will say why", job[1], exc_info=True)
                self._plans[visitor] = (turn, None)
            return


def windows_ahead(index: int, num_windows: int, num_states: int) -> Iterator[Job]:
    """What to prepare after window `index`, in order.

    Near states first (a seek there then costs one decode), near frames, then states further on; never more states
    than half of what fits (`num_states`), so that those around the visitor stay.
    """
    last = num_windows - 1
    room = min(STATES_AHEAD, num_states // 2)
    for ahead in range(1, min(NEAR, room, last - index) + 1):
        yield "state", index + ahead
    for ahead in range(1, min(FRAMES_AHEAD, last - index) + 1):
        yield "frame", index + ahead
    for ahead in range(FRAMES_AHEAD + 1, min(room, last - index) + 1):
        yield "state", index + ahead


def _do(job: Job, stage: Stage, cancelled: Callable[[], bool]) -> None:
    kind, index = job
    if kind == "state":
        stage.playback.lay_state(index, cancelled)
    elif not stage.playback.has_frame(index):
        stage.playback.at(index, cancelled=cancelled)
