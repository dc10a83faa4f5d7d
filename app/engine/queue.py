"""What visitors request for: the newest request of each, granted in turn, so that nobody starves."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Condition

from app.engine.requests import FrameRequest, Reply

Deliver = Callable[[Reply], None]
GOES_WITHOUT = 0.25
"""Seconds without a frame after which one that was asked for is finished, though a newer one is asked for by now: while
a recording plays faster than the network can follow, the newest request alone would never be granted."""

SHORT = 500.0
"""A seek that takes no longer (ms) is finished for a visitor who would otherwise go without."""
LONGEST_STRIDE = 16
"""Windows from one request to the next that still look like playing, or like a finger that goes on."""


@dataclass(eq=False, slots=True)
class PendingRequest:
    """One visitor's request, from the asking to the granting. `num_turns`: how often work on it has begun.

    `is_shown`: its frame was delivered already, and only what was wished for beside it is still to come.
    """

    visitor: str
    request: FrameRequest
    deliver: Deliver
    is_shown: bool = False
    num_turns: int = 0
    began: float = field(default_factory=time.monotonic)


class RequestQueue:
    """At most one request a visitor: a newer one replaces it. The visitor served longest ago is next."""

    def __init__(self) -> None:
        self.changed = Condition()
        self._waiting: dict[str, PendingRequest] = {}
        self._last: dict[str, PendingRequest] = {}
        self._served_at: dict[str, int] = {}
        self._granted_at: dict[str, float] = {}
        self._clock = 0
        self.version = 0
        """Counts whatever is asked and dropped: as long as it stays, the last requests do."""

    def put(self, visitor: str, request: FrameRequest, deliver: Deliver, is_shown: bool = False) -> PendingRequest:
        """Ask for something; what the visitor wished for before is forgotten."""
        with self.changed:
            turn = PendingRequest(visitor, request, deliver, is_shown)
            self._waiting[visitor] = self._last[visitor] = turn
            self._served_at.setdefault(visitor, 0)
            self._granted_at.setdefault(visitor, time.monotonic())
            self.version += 1
            self.changed.notify_all()
            return turn

    def drop(self, visitor: str) -> None:
        """Forget a visitor who has left."""
        with self.changed:
            for held in (self._waiting, self._last, self._served_at, self._granted_at):
                held.pop(visitor, None)
            self.version += 1
            self.changed.notify_all()

    def next_turn(self) -> PendingRequest | None:
        """The waiting request whose visitor was served longest ago; it stays in the book until it is settled."""
        with self.changed:
            if not self._waiting:
                return None
            turn = min(self._waiting.values(), key=lambda turn: self._served_at[turn.visitor])
            self._clock += 1
            self._served_at[turn.visitor] = self._clock
            turn.num_turns += 1
            turn.began = time.monotonic()
            return turn

    def is_wanted(self, turn: PendingRequest) -> bool:
        """Whether this very request still waits."""
        with self.changed:
            return self._waiting.get(turn.visitor) is turn

    def settle(self, turn: PendingRequest) -> bool:
        """Take the request out as granted or refused; `False` if it is not wanted any more."""
        with self.changed:
            if self._waiting.get(turn.visitor) is not turn:
                return False
            del self._waiting[turn.visitor]
            self._granted_at[turn.visitor] = time.monotonic()
            return True

    def goes_without(self, turn: PendingRequest) -> bool:
        """Whether a visitor whose requests replace each other faster than they are granted, a few windows further on
        each time, has had nothing for `GOES_WITHOUT` seconds."""
        with self.changed:
            newest = self._last.get(turn.visitor)
            if newest is None or newest.request.playback != turn.request.playback:
                return False
            goes_on = 0 <= newest.request.index - turn.request.index <= LONGEST_STRIDE
            return goes_on and time.monotonic() - self._granted_at[turn.visitor] > GOES_WITHOUT

    def settle_late(self, turn: PendingRequest) -> bool:
        """Take note that a replaced request is granted all the same; `False` where the visitor does not need it."""
        with self.changed:
            if not self.goes_without(turn):
                return False
            self._granted_at[turn.visitor] = time.monotonic()
            return True

    def others_wait(self, turn: PendingRequest) -> bool:
        """Whether anybody but this visitor waits."""
        with self.changed:
            return any(visitor != turn.visitor for visitor in self._waiting)

    @property
    def num_waiting(self) -> int:
        """Requests not yet granted."""
        with self.changed:
            return len(self._waiting)

    def last_turns(self) -> list[PendingRequest]:
        """The newest request of everybody who is here, granted or not; the most recently served first."""
        with self.changed:
            return sorted(self._last.values(), key=lambda turn: -self._served_at.get(turn.visitor, 0))
