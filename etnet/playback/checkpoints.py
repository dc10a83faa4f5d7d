"""A byte-budgeted store of recurrent states: dense at the playhead, sparse away from it."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Iterator

from etnet.nets.base import State


class Checkpoints:
    """States by the index of the window they come after, within a budget of bytes.

    When the budget is full, the state whose loss hurts least goes: the one that leaves the smallest gap relative to
    its distance from the playhead. What remains thins out with distance, so that a near seek replays little and a
    far one a bounded share of the way.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._budget_bytes = budget_bytes
        self._states: dict[int, State] = {}
        self._order: list[int] = []
        self._nbytes = 0

    def __len__(self) -> int:
        return len(self._order)

    def __iter__(self) -> Iterator[int]:
        return iter(tuple(self._order))

    def __contains__(self, index: object) -> bool:
        return index in self._states

    @property
    def nbytes(self) -> int:
        """Bytes of all states held."""
        return self._nbytes

    def get(self, index: int) -> State | None:
        """The state after window `index`, if it is held."""
        return self._states.get(index)

    def nearest_before(self, index: int) -> int | None:
        """The largest held index < `index`; `None` means a cold start from the beginning."""
        place = bisect_right(self._order, index - 1)
        return self._order[place - 1] if place else None

    def put(self, index: int, state: State, playhead: int) -> None:
        """Keep a state (detached from nothing, copied never); what exceeds the budget is dropped."""
        if index not in self._states:
            self._states[index] = state
            insort(self._order, index)
            self._nbytes += state.nbytes
        self._shrink(playhead)

    def set_budget(self, budget_bytes: int, playhead: int) -> None:
        """Change the budget; drops states when it got smaller."""
        self._budget_bytes = budget_bytes
        self._shrink(playhead)

    def clear(self) -> None:
        """Forget every state."""
        self._states.clear()
        self._order.clear()
        self._nbytes = 0

    def _shrink(self, playhead: int) -> None:
        while self._order and self._nbytes > self._budget_bytes:
            self._drop(min(range(len(self._order)), key=lambda place: self._worth(place, playhead)))

    def _worth(self, place: int, playhead: int) -> float:
        """Windows that would have to be replayed once more without this state, relative to its distance."""
        index = self._order[place]
        before = self._order[place - 1] if place else -1
        after = self._order[place + 1] if place + 1 < len(self._order) else index + 1
        return (after - before) / (1 + abs(index - playhead))

    def _drop(self, place: int) -> None:
        index = self._order.pop(place)
        self._nbytes -= self._states.pop(index).nbytes
