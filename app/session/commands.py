"""What the palette lists, and the keys that viser knows: each command is one intent, or several in a row."""

from __future__ import annotations

from collections.abc import Sequence

from app.state import intents as ask
from app.views.view import Command, View

PUBLIC_COMMANDS = (
    Command("Play or pause", "space", ask.TogglePlay()),
    Command("Play or pause ", "K", ask.TogglePlay()),
    Command("Previous window", "J", ask.Move(-1)),
    Command("Next window", "L", ask.Move(1)),
    Command("Back 10 windows", "pageup", ask.Move(-10)),
    Command("Forward 10 windows", "pagedown", ask.Move(10)),
    Command("First window", "home", ask.Seek(0)),
    Command("Last window", "end", ask.Seek(10**9)),
)
"""Through time; in public nothing else has a key of viser's."""
COMMANDS = (
    *PUBLIC_COMMANDS,
    Command("Mark A here", "I", ask.MarkHere("a")),
    Command("Mark B here", "O", ask.MarkHere("b")),
    Command("Clear marks", "U", ask.ClearMarks()),
    Command("Workspace: Inspect", "1", ask.ShowWorkspace("inspect")),
    Command("Workspace: Attention", "2", ask.ShowWorkspace("attention")),
    Command("Workspace: Compare", "3", ask.ShowWorkspace("compare")),
    Command("Workspace: Recording", "4", ask.ShowWorkspace("recording")),
    Command("Workspace: Demo", "5", ask.ShowWorkspace("demo")),
)


def commands_of(views: Sequence[View]) -> tuple[Command, ...]:
    """All commands of a page that is not public: its own, and what its views add."""
    return *COMMANDS, *(command for view in views for command in view.commands)
