"""A byte-budgeted store of decoded frames: the least recently shown goes first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable

from torch import Tensor

from etnet.nets.storage import kept_alive


class Frames:
    """Decoded frames by key, within a budget of bytes."""

    def __init__(self, budget_bytes: int) -> None:
        self._budget_bytes = budget_bytes
        self._frames: OrderedDict[Hashable, Tensor] = OrderedDict()
        self._nbytes = 0

    def __contains__(self, key: object) -> bool:
        return key in self._frames

    def keys(self) -> tuple[Hashable, ...]:
        """Every key held."""
        return tuple(self._frames)

    @property
    def nbytes(self) -> int:
        """Bytes of all frames held, with the margins that were cropped away."""
        return self._nbytes

    def get(self, key: Hashable) -> Tensor | None:
        """A frame, which counts as shown now."""
        if key in self._frames:
            self._frames.move_to_end(key)
        return self._frames.get(key)

    def put(self, key: Hashable, frame: Tensor) -> None:
        """Keep a frame; what exceeds the budget is dropped, the least recently shown first."""
        if key not in self._frames:
            self._nbytes += kept_alive((frame,))
        self._frames[key] = frame
        self._frames.move_to_end(key)
        self._shrink()

    def set_budget(self, budget_bytes: int) -> None:
        """Change the budget; drops frames when it got smaller."""
        self._budget_bytes = budget_bytes
        self._shrink()

    def _shrink(self) -> None:
        while self._frames and self._nbytes > self._budget_bytes:
            self._nbytes -= kept_alive((self._frames.popitem(last=False)[1],))
