"""How long the steps of one playback take, as they were measured."""

from __future__ import annotations

from dataclasses import dataclass

HELD_UP = 4
"""A step that took so many times as long as the next one was held up, as the first ones are on a busy machine: what it
says of the pace is forgotten."""


@dataclass(eq=False, slots=True)
class Pace:
    """How long encoding and decoding take, ms: running means over what was really done."""

    encode: float | None = None
    decode: float | None = None
    whole: float | None = None
    """Of steps that were measured as one."""

    def note_whole(self, step: float) -> None:
        """Add a measurement of a step in which nobody looked at its halves."""
        self.whole = _follow(self.whole, step)
        if self.encode is not None and self.encode > step:
            self.encode = None  # more than both halves: it was held up
        self.decode = _follow(self.decode, step - (self.encode or 0.0))

    def note(self, encode: float | None, decode: float | None) -> None:
        """Add a measurement; the mean follows it by a third."""
        self.encode = _follow(self.encode, encode)
        self.decode = _follow(self.decode, decode)

    @property
    def step(self) -> float | None:
        """One whole step, ms; `None` before it, or both halves, were measured."""
        return self.whole if self.encode is None or self.decode is None else self.encode + self.decode

    def seek(self, num_replayed: int) -> float:
        """What a seek over so many windows will take, ms; 0 while nothing was measured."""
        return (self.encode or 0.0) * num_replayed + (self.decode or 0.0)


def _follow(mean: float | None, value: float | None) -> float | None:
    if value is None or mean is None:
        return mean if value is None else value
    if value < mean / HELD_UP:
        return value
    return mean + (value - mean) / 3
