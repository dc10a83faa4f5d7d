"""The moment is shared by all views; the strip keeps nothing of its own but says what its buttons mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from app.html.choices import PLAYED
from app.state import intents as ask

SPEEDS: dict[str, ask.ChooseSpeed] = {
    **{name: ask.ChooseSpeed(speed) for name, speed in PLAYED.items()},
    "step": ask.ChooseSpeed(min(PLAYED.values()), waits_for_frames=True),
}
"""Shares of real time; "step" shows every window and waits for its frame."""
_WORDS: dict[str, Any] = {
    "first": ask.Seek(0),
    "back": ask.Move(-1),
    "play": ask.TogglePlay(),
    "on": ask.Move(1),
    "last": ask.Seek(10**9),
    "loop": ask.SetLoop(True),
    "once": ask.SetLoop(False),
    "a": ask.MarkHere("a"),
    "b": ask.MarkHere("b"),
    "clear": ask.ClearMarks(),
    **{f"speed {name}": intent for name, intent in SPEEDS.items()},
}


@dataclass(frozen=True, slots=True)
class TimelineState:
    """The moment is shared by all views; the strip keeps nothing of its own."""

    view: ClassVar[str] = "timeline"


def hear(words: str) -> Any:
    """What a click on a button of the timeline says; `None` for what none of them sends."""
    return _WORDS.get(words)


def speed_of(speed: float, waits_for_frames: bool) -> str:
    """The name of the speed that holds; empty for one that is none of those offered."""
    if waits_for_frames:
        return "step"
    return next((name for name, at in SPEEDS.items() if abs(at.speed - speed) < 1e-9), "")
