"""What the demo points at while nobody touches the page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from app.state.checks import passing
from app.views.view import Here

Act = Literal["none", "events", "image", "places"]


@dataclass(frozen=True, slots=True)
class PointAt:
    """The demo leads and points at one of its pictures; "none": a visitor leads."""

    act: Act


@dataclass(frozen=True, slots=True)
class DemoState:
    """The act that is played."""

    view: ClassVar[str] = "demo"
    act: Act = passing("none")


def reduce_demo(slice_: DemoState, intent: Any, here: Here) -> DemoState:
    """Only a page in public points at anything."""
    if isinstance(intent, PointAt) and here.state.is_public:
        return replace(slice_, act=intent.act)
    return slice_
