"""The part of a view that shows things to others: the demo's acts, and what is being taken away."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

Act = Literal["none", "events", "image", "places"]
"""What the demo points at while nobody touches it."""


@dataclass(frozen=True, slots=True)
class PointAt:
    """The demo leads and points at one of its pictures; "none": a visitor leads."""

    act: Act


ShowIntent = PointAt


@dataclass(frozen=True, slots=True)
class ShowView:
    """`is_demo`: the page stands in public; it was started so, and no visitor can change that."""

    is_demo: bool = False
    act: Act = "none"


def reduce_show(show: ShowView, intent: ShowIntent) -> ShowView:
    """The part after `intent`."""
    match intent:
        case PointAt(act):
            return replace(show, act=act) if show.is_demo else show
