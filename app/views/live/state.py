"""What can be asked of a live source. All visitors share it, so a page keeps nothing of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from app.catalogue.visitor import VisitorCatalogue
from app.state import intents as ask


@dataclass(frozen=True, slots=True)
class Record:
    """Begin to write a file, or finish it."""

    turn: Literal["on", "off"]


@dataclass(frozen=True, slots=True)
class ChangeSetting:
    """Give one setting of the source another value."""

    name: str
    value: int


@dataclass(frozen=True, slots=True)
class FollowRate:
    """Let the biases follow, so that the event rate stays between two rates (Mev/s), or leave them as they are."""

    is_on: bool
    lowest: float
    highest: float


@dataclass(frozen=True, slots=True)
class LiveState:
    """Nothing of one page alone."""

    view: ClassVar[str] = "live"


_WORDS: dict[str, Any] = {"follow": ask.FollowNewest(), "record": Record("on"), "stop": Record("off")}


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    return _WORDS.get(words)


def perform(intent: Any, catalogue: VisitorCatalogue) -> None:
    """Record, or change settings, for those who may: the page of anybody else has no such control."""
    if not isinstance(intent, Record | ChangeSetting | FollowRate) or (feed := catalogue.live_control()) is None:
        return
    match intent:
        case Record("on"):
            feed.begin(feed.record)
        case Record("off"):
            feed.begin(feed.stop_recording)
        case ChangeSetting(name, value):
            feed.begin(lambda: feed.change(name, value))
        case FollowRate(is_on, lowest, highest):
            feed.begin(lambda: feed.follow_rate((lowest, highest) if is_on else None))
