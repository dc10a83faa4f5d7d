"""What steps back in time mean: small disorder, a turn of a 32-bit clock, a restarted clock, or no time at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

PERIOD = 1 << 32
"""µs after which a clock of 32 bits wraps: 71.6 minutes."""

SMALL_STEP_BACK = 1000
"""µs. Cameras' own clocks step back this little between packets; more is a fault that a person must decide about."""

_MANY = 0.01
"""Share of events before their predecessor from which on a column is hardly a clock."""

_NEAR = 0.1
"""Share of what the clock went through up to which it counts as back at its beginning."""

_FEWEST_AFTER = 10
"""Events that follow a restart at least; fewer are strays."""


@dataclass
class StampOrder:
    """What was seen of the stamps' order so far, µs."""

    num_events: int = 0
    first: int | None = None
    last: int | None = None
    highest: int = 0
    num_back: int = 0
    num_restarts: int = 0
    first_back: int = 0
    before_back: int = 0
    after_back: int = 0
    farthest: int = 0
    since_back: int = 0

    def look(self, t: Int64[np.ndarray, " n"], index: int, ordered: bool) -> None:
        """Take in a piece whose first event is number `index`; `ordered` if it never steps back within itself."""
        if self.last is None or self.first is None:
            self.first, self.last, self.highest = int(t[0]), int(t[0]), int(t[0])
        before, self.last = self.last, int(t[-1])
        self.num_events += len(t)
        if ordered and t[0] >= before:
            self.since_back += len(t)
            self.highest = max(self.highest, int(t[-1]))
            return
        steps = np.diff(t, prepend=before)
        back = np.flatnonzero(steps < 0)
        if self.num_back == 0:
            place = int(back[0])
            self.first_back = index + place
            self.after_back, self.before_back = int(t[place]), int(t[place] - steps[place])
        self.highest = max(self.highest, before, int(t.max()))
        reach = max(self.highest - self.first, 1)
        is_restart = (-steps[back] > (1 - _NEAR) * reach) & (t[back] - self.first < _NEAR * reach)
        self.num_back += len(back)
        self.num_restarts += int(np.count_nonzero(is_restart))
        self.farthest = max(self.farthest, -int(steps.min()))
        self.since_back = len(t) - int(back[-1])

    def scale(self, factor: float) -> None:
        """The stamps were in another unit than was thought: so many µs are one of what was taken for one."""
        for name in ("first", "last", "highest", "before_back", "after_back", "farthest"):
            setattr(self, name, round((getattr(self, name) or 0) * factor))

    @property
    def is_ordered(self) -> bool:
        """Whether time never ran back."""
        return self.num_back == 0

    @property
    def is_small(self) -> bool:
        """Whether sorting changes nothing that matters."""
        return self.farthest <= SMALL_STEP_BACK

    def fault(self) -> str:
        """What is wrong with it and what to do, for an error that begins with the file's name."""
        back = f"at event {self.first_back} ({self.before_back} > {self.after_back} µs)"
        if self.num_back > max(3, _MANY * self.num_events):
            return (
                f"time runs back at {self.num_back:,} of {self.num_events:,} events, first {back}: the column that is "
                "taken for the time is probably another one; name the columns, or give them in the order t x y p"
            )
        if self.num_restarts == self.num_back and self.since_back >= _FEWEST_AFTER:
            times = "once" if self.num_back == 1 else f"{self.num_back} times"
            return (
                f"the clock restarts {times}, first {back}: these are {self.num_back + 1} recordings one after "
                "another, and sorting would mix them; cut the file there"
            )
        times = "once" if self.num_back == 1 else f"{self.num_back} times, first"
        return f"time runs back {times} {back}, by up to {self.farthest} µs; open it with --sort"

    def repair(self) -> str:
        """What is said where the events were sorted."""
        return (
            f"time ran back {self.num_back} times, first at event {self.first_back}, by up to {self.farthest} µs; "
            "the events were sorted by timestamp"
        )


_NONE = np.empty(0, np.int64)


@dataclass
class Clock32:
    """Goes on where a clock of 32 bits wraps, piece by piece."""

    last: int | None = None
    turns: int = 0

    def unrolled(self, t: Int64[np.ndarray, " n"], ordered: bool = False) -> Int64[np.ndarray, " n"]:
        """The stamps of the next piece; the same array where the clock never turned so far.

        `ordered`: it is known that they never step back among themselves.
        """
        if len(t) == 0:
            return t
        goes_on = ordered and (self.last is None or int(t[0]) >= self.last)
        turned = _NONE if goes_on else turns_in(t, self.last)
        self.last = int(t[-1])
        if self.turns == 0 and len(turned) == 0:
            return t
        shift = np.zeros(len(t), np.int64)
        shift[turned] = 1
        shift = self.turns + np.cumsum(shift)
        self.turns = int(shift[-1])
        return t + shift * PERIOD


def turns_in(t: Int64[np.ndarray, " n"], before: int | None = None) -> Int64[np.ndarray, " m"]:
    """Where stamps fall from the end of 32 bits to their beginning; `before` is the stamp before the first.

    A smaller step, or one from elsewhere, is disorder and not a turn.
    """
    steps = np.diff(t, prepend=t[:1] if before is None else before)
    back = np.flatnonzero(steps < -(PERIOD // 2))
    if len(back) == 0:
        return back
    after = t[back]
    low = 0 if int(t.min()) >= 0 else -(PERIOD // 2)  # as signed numbers they turn from 2³¹ to −2³¹
    edge = PERIOD // 4
    is_turn = (after - steps[back] >= low + PERIOD - edge) & (after - steps[back] < low + PERIOD) & (after < low + edge)
    return back[is_turn]
