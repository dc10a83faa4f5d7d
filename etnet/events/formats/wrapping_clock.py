"""Clocks of a fixed number of bits that begin anew at their end: their stamps are taken to go on."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Int64

from etnet.events.assumptions import TimeUnit
from etnet.events.formats.base import Remarks
from etnet.events.formats.time_unit import PER_SECOND

PERIOD = 1 << 32
"""µs after which a clock of 32 bits wraps: 71.6 minutes."""

_EDGE = 4
"""A turn of 32 bits begins in the last quarter of its period and ends in the first."""

_OTHER_WIDTHS = (16, 24, 31, 34)
"""Bits of further counters that cameras and their drivers have."""

_NARROW_EDGE = 512
"""The same of those, of which it must be more certain: a clock may have been restarted there by chance."""

_FEW = 10
"""Stamps after a leap to the end of the clock that are strays, if it then falls back: a clock that turns gets there."""

_NONE = np.empty(0, np.int64)


@dataclass
class WrappingClock:
    """Goes on where a clock wraps, piece by piece. `bits` is its width, as soon as it turned once."""

    recent: Int64[np.ndarray, " few"] = field(default_factory=lambda: _NONE)
    """The last stamps before the next piece, as they were stored."""
    turns: int = 0
    bits: int = 0

    def unrolled(self, t: Int64[np.ndarray, " n"], ordered: bool = False) -> Int64[np.ndarray, " n"]:
        """The stamps of the next piece; the same array where the clock never turned so far.

        `ordered`: it is known that they never step back among themselves.
        """
        if len(t) == 0:
            return t
        goes_on = ordered and (len(self.recent) == 0 or t[0] >= self.recent[-1])
        turned = _NONE if goes_on else self._turns(t)
        self.recent = np.concatenate([self.recent, t[-_FEW - 1 :]])[-_FEW - 1 :]
        if self.turns == 0 and len(turned) == 0:
            return t
        shift = np.zeros(len(t), np.int64)
        shift[turned] = 1
        shift = self.turns + np.cumsum(shift)
        self.turns = int(shift[-1])
        return t + (shift << self.bits)

    def _turns(self, t: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " m"]:
        """Where stamps fall from the end of the clock to its beginning; any other step back is no turn."""
        known = np.concatenate([self.recent, t])
        steps = np.diff(known, prepend=known[:1])
        back = len(self.recent) + np.flatnonzero(steps[len(self.recent) :] < 0)
        after = known[back]
        before = after - steps[back]
        for bits in (self.bits,) if self.bits else (32, *_OTHER_WIDTHS):
            is_turn = _is_turn(before, after, bits, is_signed=int(t.min()) < 0)
            turned = _without_strays(back[is_turn], steps, bits) if is_turn.any() else _NONE
            if len(turned):
                self.bits = bits
                return turned - len(self.recent)
        return _NONE

    def say(self, remarks: Remarks, unit: TimeUnit = "us") -> None:
        """That it turned, if it did; once."""
        if not self.turns:
            return
        text = (
            f"the {self.bits}-bit stamps wrap (every {_lasts((1 << self.bits) / PER_SECOND[unit])}) and were unrolled"
        )
        if not any(remark.text == text for remark in remarks.kept):
            remarks.repaired(text)


def _is_turn(before: np.ndarray, after: np.ndarray, bits: int, is_signed: bool) -> np.ndarray:
    period = 1 << bits
    edge = period // (_EDGE if bits == 32 else _NARROW_EDGE)
    low = -(period // 2) if is_signed and bits == 32 else 0  # as signed numbers they turn from 2³¹ to −2³¹
    return (before >= low + period - edge) & (before < low + period) & (after >= low) & (after < low + edge)


def _without_strays(
    turned: Int64[np.ndarray, " n"], steps: Int64[np.ndarray, " m"], bits: int
) -> Int64[np.ndarray, " k"]:
    """The turns but those that only take back a leap up, of half a period or more, a few stamps before."""
    leaps = np.flatnonzero(np.abs(steps) > 1 << (bits - 1))
    latest = np.searchsorted(leaps, turned) - 1
    leap = leaps[latest]  # of a turn without any before it, the last one: it is not before it
    is_stray = (latest >= 0) & (steps[leap] > 0) & (turned - leap <= _FEW)
    return turned[~is_stray]


def _lasts(seconds: float) -> str:
    for limit, per, unit in ((1, 1e-3, "ms"), (120, 1, "s"), (7200, 60, "minutes")):
        if seconds < limit:
            return f"{seconds / per:.1f} {unit}"
    return f"{seconds / 3600:.1f} hours"
