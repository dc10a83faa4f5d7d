"""What steps back in time mean: disorder, a restarted clock, rows from last to first, or a column that is no time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int64

SMALL_STEP_BACK = 1000
"""µs. Cameras' own clocks step back this little between packets; more is a fault that a person must decide about."""

_MANY = 0.01
"""Share of events before their predecessor from which on a column is hardly a clock."""

_ROUGH = 0.1
"""Share of the whole time by which a clock may fall back, however often, and is still one."""

_NEAR = 0.1
"""Share of what the clock went through up to which it counts as back at its beginning."""

_SORT = "open it with --sort"

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
    goes_forward: bool = False

    def look(self, t: Int64[np.ndarray, " n"], index: int, ordered: bool) -> None:
        """Take in a piece whose first event is number `index`; `ordered` if it never steps back within itself."""
        if self.last is None or self.first is None:
            self.first, self.last, self.highest = int(t[0]), int(t[0]), int(t[0])
        before, self.last = self.last, int(t[-1])
        self.num_events += len(t)
        if ordered and t[0] >= before:
            self.since_back += len(t)
            self.highest = max(self.highest, int(t[-1]))
            self.goes_forward = self.goes_forward or int(t[-1]) > before
            return
        steps = np.diff(t, prepend=before)
        back = np.flatnonzero(steps < 0)
        if self.num_back == 0:
            place = int(back[0])
            self.first_back = index + place
            self.after_back, self.before_back = int(t[place]), int(t[place] - steps[place])
        latest = np.maximum(np.maximum.accumulate(t), max(self.highest, before))
        self.highest = int(latest[-1])
        reach = max(self.highest - self.first, 1)
        is_restart = (-steps[back] > (1 - _NEAR) * reach) & (np.abs(t[back] - self.first) < _NEAR * reach)
        self.num_back += len(back)
        self.num_restarts += int(np.count_nonzero(is_restart))
        self.farthest = max(self.farthest, int((latest - t).max()))
        self.since_back = len(t) - int(back[-1])
        self.goes_forward = self.goes_forward or bool((steps > 0).any())

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

    @property
    def is_restarted(self) -> bool:
        """Whether every step back is to about the first stamp, and time goes on after it."""
        return 0 < self.num_restarts == self.num_back and self.since_back >= _FEWEST_AFTER

    def fault(self) -> str:
        """What is wrong with it and what to do, for an error that begins with the file's name."""
        back = f"at event {self.first_back} ({self.before_back} > {self.after_back} µs)"
        if not self.goes_forward and self.num_back > 1:
            return f"time runs back from the first event to the last, first {back}: the rows are in reverse; {_SORT}"
        is_rough = self.farthest <= _ROUGH * (self.highest - (self.first or 0))
        if self.num_back > max(3, _MANY * self.num_events) and not is_rough:
            return (
                f"time runs back at {self.num_back:,} of {self.num_events:,} events, first {back}: the column that is "
                "taken for the time is probably another one; name the columns, or give them in the order t x y p"
            )
        if self.is_restarted:
            times = "once" if self.num_back == 1 else f"{self.num_back} times"
            return (
                f"the clock restarts {times}, first {back}: these are {self.num_back + 1} recordings one after "
                "another, and sorting would mix them; cut the file there"
            )
        times = "once" if self.num_back == 1 else f"{self.num_back} times, first"
        return f"time runs back {times} {back}, by up to {self.farthest} µs; {_SORT}"

    def repair(self) -> str:
        """What is said where the events were sorted."""
        return (
            f"time ran back {self.num_back} times, first at event {self.first_back}, by up to {self.farthest} µs; "
            "the events were sorted by timestamp"
        )
