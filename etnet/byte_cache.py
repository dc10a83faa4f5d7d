"""Values within a budget of bytes, the least recently used going first: pictures, frames, attention, answers."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from sys import getsizeof
from threading import Lock
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")
Made = TypeVar("Made")


class ByteCache(Generic[Key, Value]):
    """Values by key. Safe from all threads.

    Two threads that miss at once both make the value, which is pure, and the first one's stays: no thread ever waits
    for another's drawing.
    """

    def __init__(self, budget_bytes: int, overhead: int = 256, fewest: int = 0) -> None:
        """`overhead`: bytes that are added to each value. The newest `fewest` values stay, whatever they weigh."""
        self._budget_bytes, self._overhead, self._fewest = budget_bytes, overhead, fewest
        self._values: OrderedDict[Key, tuple[Value, int]] = OrderedDict()
        self._nbytes = 0
        self._lock = Lock()

    def find(self, key: Key) -> Value | None:
        """The value of `key`, which counts as used now; `None` where it is not held."""
        with self._lock:
            if key not in self._values:
                return None
            self._values.move_to_end(key)
            return self._values[key][0]

    def keep(self, key: Key, value: Value, nbytes: int) -> None:
        """Hold a value of `nbytes`, in place of an earlier one; one beyond the whole budget is not held."""
        size = nbytes + self._overhead
        with self._lock:
            if (former := self._values.pop(key, None)) is not None:
                self._nbytes -= former[1]
            if size <= self._budget_bytes or self._fewest:
                self._values[key] = (value, size)
                self._nbytes += size
                self._shrink()

    def get(self, key: Key, make: Callable[[], Made], nbytes: Callable[[Made], int] = lambda made: 0) -> Made:
        """The value of `key`, made now if it is not held. `nbytes` weighs it."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key][0]  # pyright: ignore[reportReturnType]  the key says which type it holds
        made = make()
        if key not in self:
            self.keep(key, made, nbytes(made))  # pyright: ignore[reportArgumentType]
        return made

    def text(self, key: Key, make: Callable[[], str]) -> str:
        """A string, weighed by what it occupies: one “ or – in it, and every sign of it takes two bytes."""
        return self.get(key, make, getsizeof)

    def forget(self, matches: Callable[[Key], bool]) -> None:
        """Forget every value whose key matches."""
        with self._lock:
            for key in [key for key in self._values if matches(key)]:
                self._nbytes -= self._values.pop(key)[1]

    def set_budget(self, budget_bytes: int) -> None:
        """Change the budget; what no longer fits goes."""
        with self._lock:
            self._budget_bytes = budget_bytes
            self._shrink()

    def keys(self) -> tuple[Key, ...]:
        """Every key held, the least recently used first."""
        with self._lock:
            return tuple(self._values)

    def values(self) -> tuple[Value, ...]:
        """Every value held, in the same order."""
        with self._lock:
            return tuple(value for value, _ in self._values.values())

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self._nbytes

    def __contains__(self, key: object) -> bool:
        return key in self._values

    def __len__(self) -> int:
        return len(self._values)

    def _shrink(self) -> None:
        while len(self._values) > self._fewest and self._nbytes > self._budget_bytes:
            self._nbytes -= self._values.popitem(last=False)[1][1]
