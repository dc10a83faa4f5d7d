"""What can be done to events before a network sees them, as a value: leave out, invert or shift in time a share."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Float64

from etnet.events.events import Events

_DRAWS_A_BLOCK = 4
"""64-bit numbers that one count of Philox gives."""


class _Purpose(IntEnum):
    """What a stream of random numbers decides; each has its own, so that one share does not move another's dice."""

    DROP = 0
    INVERT = 1
    JITTER = 2
    SHIFT = 3


@dataclass(frozen=True, slots=True)
class EventEdit:
    """Drop, invert or jitter a share of the events; hashable, so that caches can be keyed by it.

    An event's fate follows from `seed` and its index in the recording alone: it is the same in every window and in
    every order of asking, and a larger share changes the events that a smaller one did, and more.
    """

    drop: float = 0.0
    """Share of events left out."""
    invert: float = 0.0
    """Share of events whose polarity is turned."""
    jitter: float = 0.0
    """Share of events moved in time."""
    jitter_by: int = 1_000
    """Farthest move, µs, uniform to both sides; an event never leaves the span of its window's events."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("drop", "invert", "jitter"):
            share = getattr(self, name)
            if not 0 <= share <= 1:
                raise ValueError(f"EventEdit.{name} is {share}; it is a share of the events, 0 … 1")
        if self.jitter_by < 0 or self.seed < 0:
            raise ValueError(f"EventEdit: got jitter_by {self.jitter_by} µs and seed {self.seed}; both are at least 0")

    @property
    def changes_nothing(self) -> bool:
        """Whether every event stays as it is."""
        return not (self.drop or self.invert or (self.jitter and self.jitter_by))

    def applied(self, events: Events, first_index: int) -> Events:
        """The edited events, in the order of time; `first_index` is the recording's index of the first of them."""
        if self.changes_nothing or not len(events):
            return events
        t, p = events.t, events.p
        if self.invert:
            p = np.where(self._is_chosen(self.invert, _Purpose.INVERT, first_index, len(events)), -p, p)
        if self.jitter and self.jitter_by:
            is_moved = self._is_chosen(self.jitter, _Purpose.JITTER, first_index, len(events))
            shift = np.rint((2 * self._draw(_Purpose.SHIFT, first_index, len(events)) - 1) * self.jitter_by)
            t = np.clip(np.where(is_moved, t + shift.astype(np.int64), t), events.t[0], events.t[-1])
        kept = ~self._is_chosen(self.drop, _Purpose.DROP, first_index, len(events))
        order = np.flatnonzero(kept)
        order = order[np.argsort(t[order], kind="stable")]
        return Events(events.x[order], events.y[order], t[order], p[order].astype(np.int8), events.sensor)

    def _is_chosen(self, share: float, purpose: _Purpose, first_index: int, num_events: int) -> np.ndarray:
        return self._draw(purpose, first_index, num_events) < share

    def _draw(self, purpose: _Purpose, first_index: int, num_events: int) -> Float64[np.ndarray, " n"]:
        """Uniform in 0 … 1 for each event, by its index: Philox is a counter, so any stretch can be drawn alone."""
        block, offset = divmod(first_index, _DRAWS_A_BLOCK)
        bits = np.random.Philox(key=[self.seed, purpose], counter=[block, 0, 0, 0])
        return np.random.Generator(bits).random(offset + num_events)[offset:]


UNEDITED = EventEdit()
