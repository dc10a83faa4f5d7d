"""What stamps count where nothing settles it: the usual unit, unless only another one makes a recording of them.

A camera gives at least a thousandth of an event per pixel and second, and no recording lasts longer than a day. Where
the unit is a mere convention (seconds in event_utils, µs for whole numbers), that is held against the events.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from etnet.events.assumptions import Assumptions, TimeUnit, said_unit
from etnet.events.formats.base import Remarks

PER_SECOND: dict[TimeUnit, int] = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}

UNITS: tuple[TimeUnit, ...] = ("us", "ns", "s", "ms")
"""The commonest first."""

LONGEST = 86_400.0
"""Seconds that a recording may last."""

LEAST_RATE = 1e-3
"""Events per pixel and second, on average; a dark, still scene gives more by noise alone."""

MOST_RATE = 1e3
"""The same at the other end; a readout of 10⁹ events a second is as much."""

_BUSY_RATE, _BUSY = 1e2, 1e7
"""Events per pixel and second, and events a second, that together no scene gives for all of a recording."""

_ENOUGH = 100
"""Events from which on a rate says something."""

_USUAL_RATE = 3.0
_SHORTEST = 0.01
"""Seconds below which it is doubtful that somebody kept a recording."""

_DOUBT = {"us": 0.0, "ms": 1.0, "ns": 1.0, "s": 1.0}
"""How much rarer than µs a unit is, in powers of ten by which its rate must fit better."""

_EPOCH = (8e8, 4e9)
"""Seconds since 1970: the years 1995 to 2096."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is known of the stamps: first and last as the file has them, of how many events on how many pixels."""

    num_events: int
    first: float
    last: float
    num_pixels: int
    has_fractions: bool
    is_fine: bool = True
    """Whether any has more than three digits after the point; those of ms that count µs have not."""

    def seconds(self, unit: TimeUnit) -> float:
        """How long it lasts if stamps count `unit`."""
        return (self.last - self.first) / PER_SECOND[unit]

    def rate(self, unit: TimeUnit) -> float:
        """Events per pixel and second, if so."""
        return self.num_events / max(1, self.num_pixels) / max(self.seconds(unit), 1e-12)

    def is_possible(self, unit: TimeUnit) -> bool:
        """Whether a camera could have made it. Of very few events, or of one stamp only, nothing can be said."""
        if self.seconds(unit) <= 0:
            return True
        # Seconds with fractions of µs are seldom anything else: less is held against them.
        least = LEAST_RATE / 10 if unit == "s" and self.has_fractions and self.is_fine else LEAST_RATE
        return self.seconds(unit) <= LONGEST and (self.num_events < _ENOUGH or self.rate(unit) >= least)

    def said(self, unit: TimeUnit) -> str:
        """What it would come to, in words."""
        lasts = self.seconds(unit)
        return f"{lasts:,.4g} s with {self.num_events / max(lasts, 1e-12):,.3g} events a second"


def judged_unit(
    evidence: Evidence, assume: Assumptions, remarks: Remarks, usual: TimeUnit | None = None, layout: str = ""
) -> TimeUnit:
    """The unit that is stated, else the usual one of the layout, else that of such numbers, if the result makes sense.

    `usual` is what `layout` counts by convention.
    """
    if assume.time_unit is not None:
        remarks.assumed(said_unit(assume.time_unit))
        return assume.time_unit
    first, why = (usual, f"{layout} does") if usual is not None else _by_kind(evidence)
    unit = first if evidence.is_possible(first) else _other(evidence, first)
    if unit == first and usual is None:
        unit = _slower(evidence, first)
    if unit is not None and unit != first:
        remarks.assumed(
            f"time unit {unit}: in {first}, because {why}, the timestamps would be {evidence.said(first)}; "
            f"in {unit} they are {evidence.said(unit)}; --time-unit overrules"
        )
        return unit
    if usual is None:
        remarks.assumed(f"time unit {first}, because {why}; --time-unit overrules")
    if unit is None:
        remarks.advise(
            f"the stamps make no recording in any unit: in {first}, because {why}, they are {evidence.said(first)}; "
            "check which column is the time, or state --time-unit s, ms, us or ns"
        )
    return first


def _by_kind(evidence: Evidence) -> tuple[TimeUnit, str]:
    if evidence.has_fractions:
        return "s", "they have fractions"
    if abs(evidence.last) > 1e17:
        return "ns", "they are beyond 10¹⁷"
    return "us", "they are whole numbers"


def _slower(evidence: Evidence, first: TimeUnit) -> TimeUnit:
    """`first`, unless it gives more than a scene does and ms give what one does; or they are ms since 1970."""
    if first != "us" or evidence.num_events < _ENOUGH or not evidence.is_possible("ms"):
        return first
    is_busy = evidence.rate("us") > _BUSY_RATE and evidence.rate("us") * evidence.num_pixels > _BUSY
    is_odd = is_busy or _is_epoch(evidence, PER_SECOND["ms"])
    return "ms" if is_odd and _oddness(evidence, "ms") < _oddness(evidence, "us") else first


def _is_epoch(evidence: Evidence, per_second: int) -> bool:
    return all(_EPOCH[0] * per_second <= stamp <= _EPOCH[1] * per_second for stamp in (evidence.first, evidence.last))


def _other(evidence: Evidence, first: TimeUnit) -> TimeUnit | None:
    """Of the other units the one whose rate is most like a camera's; of stamps since 1970, the one they are in."""
    possible: list[TimeUnit] = [
        unit
        for unit in UNITS
        if unit != first and evidence.is_possible(unit) and evidence.rate(unit) <= MOST_RATE
        if not (unit == "ns" and evidence.has_fractions)
    ]
    since_1970: list[TimeUnit] = [unit for unit in possible if _is_epoch(evidence, PER_SECOND[unit])]
    return min(since_1970 or possible, key=lambda unit: _misfit(evidence, unit), default=None)


def _misfit(evidence: Evidence, unit: TimeUnit) -> float:
    # Three digits after the point are those of µs in ms.
    doubt = -1.0 if unit == "ms" and evidence.has_fractions and not evidence.is_fine else _DOUBT[unit]
    return _oddness(evidence, unit) + doubt


def _oddness(evidence: Evidence, unit: TimeUnit) -> float:
    """Powers of ten between its rate and a camera's, and between its length and the shortest that people keep."""
    too_short = math.log10(max(1.0, _SHORTEST / max(evidence.seconds(unit), 1e-12)))
    return abs(math.log10(evidence.rate(unit) / _USUAL_RATE)) + too_short
