"""What visitors wish for: the newest wish of each, granted in turn, so that nobody starves."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Condition

from app.wishes import Reply, Wish

Deliver = Callable[[Reply], None]


@dataclass(eq=False, slots=True)
class Turn:
    """One visitor's wish, from the asking to the granting. `num_turns`: how often work on it has begun.

    `is_shown`: its frame was delivered already, and only what was wished for beside it is still to come.
    """

    visitor: str
    wish: Wish
    deliver: Deliver
    is_shown: bool = False
    num_turns: int = 0
    began: float = field(default_factory=time.monotonic)


class WishBook:
    """At most one wish a visitor: a newer one replaces it. Whoever was served longest ago is next."""

    def __init__(self) -> None:
        self.changed = Condition()
        self._waiting: dict[str, Turn] = {}
        self._last: dict[str, Turn] = {}
        self._served_at: dict[str, int] = {}
        self._clock = 0

    def put(self, visitor: str, wish: Wish, deliver: Deliver, is_shown: bool = False) -> Turn:
        """Wish for something; what the visitor wished for before is forgotten."""
        with self.changed:
            turn = Turn(visitor, wish, deliver, is_shown)
            self._waiting[visitor] = self._last[visitor] = turn
            self._served_at.setdefault(visitor, 0)
            self.changed.notify_all()
            return turn

    def drop(self, visitor: str) -> None:
        """Forget a visitor who has left."""
        with self.changed:
            for held in (self._waiting, self._last, self._served_at):
                held.pop(visitor, None)
            self.changed.notify_all()

    def next_turn(self) -> Turn | None:
        """The waiting wish whose visitor was served longest ago; it stays in the book until it is settled."""
        with self.changed:
            if not self._waiting:
                return None
            turn = min(self._waiting.values(), key=lambda turn: self._served_at[turn.visitor])
            self._clock += 1
            self._served_at[turn.visitor] = self._clock
            turn.num_turns += 1
            turn.began = time.monotonic()
            return turn

    def is_wanted(self, turn: Turn) -> bool:
        """Whether this very wish still waits."""
        with self.changed:
            return self._waiting.get(turn.visitor) is turn

    def settle(self, turn: Turn) -> bool:
        """Take the wish out as granted or refused; `False` if it is not wanted any more."""
        with self.changed:
            if self._waiting.get(turn.visitor) is not turn:
                return False
            del self._waiting[turn.visitor]
            return True

    def others_wait(self, turn: Turn) -> bool:
        """Whether anybody but this visitor waits."""
        with self.changed:
            return any(visitor != turn.visitor for visitor in self._waiting)

    @property
    def num_waiting(self) -> int:
        """Wishes not yet granted."""
        with self.changed:
            return len(self._waiting)

    def last_turns(self) -> list[Turn]:
        """The newest wish of everybody who is here, granted or not; the most recently served first."""
        with self.changed:
            return sorted(self._last.values(), key=lambda turn: -self._served_at.get(turn.visitor, 0))
