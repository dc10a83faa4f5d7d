"""Pictures made once and shown to every visitor: a small store with a byte budget, safe from all threads."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from sys import getsizeof
from threading import Lock
from typing import TypeVar

Value = TypeVar("Value")


class ByteCache:
    """Values by key; the least recently used go when `budget_bytes` is exceeded.

    Two threads that miss at once both make the value, which is pure, and the first one's stays: no thread ever waits
    for another's drawing.
    """

    def __init__(self, budget_bytes: int) -> None:
        self._budget_bytes = budget_bytes
        self._values: OrderedDict[Hashable, tuple[object, int]] = OrderedDict()
        self._nbytes = 0
        self._lock = Lock()

    def get(self, key: Hashable, make: Callable[[], Value], nbytes: Callable[[Value], int] = lambda v: 0) -> Value:
        """The value of `key`, made now if it is not held. `nbytes` weighs a value; 256 bytes are added for the rest."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key][0]  # pyright: ignore[reportReturnType]  the key says which type it holds
        made = make()
        size = nbytes(made) + 256
        with self._lock:
            if key not in self._values and size <= self._budget_bytes:
                self._values[key] = (made, size)
                self._nbytes += size
                while self._nbytes > self._budget_bytes:
                    self._nbytes -= self._values.popitem(last=False)[1][1]
        return made

    def text(self, key: Hashable, make: Callable[[], str]) -> str:
        """A string, weighed by what it occupies: one “ or – in it, and every sign of it takes two bytes."""
        return self.get(key, make, getsizeof)

    def forget(self, word: str) -> None:
        """Forget every value in whose key this word stands: a recording's id that no other key can hold."""
        with self._lock:
            for key in [key for key in self._values if word in repr(key)]:
                self._nbytes -= self._values.pop(key)[1]

    @property
    def nbytes(self) -> int:
        """Bytes held."""
        return self._nbytes

    def __len__(self) -> int:
        return len(self._values)
