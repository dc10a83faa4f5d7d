"""What the palette lists, and the keys that viser knows: each command is one intent, or several in a row."""

from __future__ import annotations

from typing import Any

from app.state import intents as ask
from app.views.attention.state import Compare, PinMap, StepHead, StepSite, Unpin
from app.views.inspect.html.overview import INSPECTORS
from app.views.inspect.state import ResetAll, ShowOriginal
from app.views.scene.state import ChooseCamera

_TOKEN = 8
"""Pixels on its side."""
_ATTENTION: tuple[tuple[str, str | None, Any], ...] = (
    ("Attention: next site", None, StepSite(1)),
    ("Attention: previous site", None, StepSite(-1)),
    ("Attention: next head", None, StepHead(1)),
    ("Attention: previous head", None, StepHead(-1)),
    ("Attention: all heads", None, ask.Set("attention", "head", None)),
    ("Attention: query a token to the left", None, ask.MoveQuery(-_TOKEN, 0)),
    ("Attention: query a token to the right", None, ask.MoveQuery(_TOKEN, 0)),
    ("Attention: query a token up", None, ask.MoveQuery(0, -_TOKEN)),
    ("Attention: query a token down", None, ask.MoveQuery(0, _TOKEN)),
    ("Attention: follow the patch under the pixel", None, ask.Set("attention", "follows", True)),
    ("Attention: stay at the pixel", None, ask.Set("attention", "follows", False)),
    ("Attention: pin this map as A", None, PinMap("a")),
    ("Attention: pin this map as B", None, PinMap("b")),
    ("Attention: compare with A", None, Compare("a")),
    ("Attention: compare with B", None, Compare("b")),
    ("Attention: compare with nothing", None, Compare("none")),
    ("Attention: unpin A", None, Unpin("a")),
    ("Attention: unpin B", None, Unpin("b")),
    ("Change: show the original", None, ShowOriginal(True)),
    ("Change: show it changed again", None, ShowOriginal(False)),
    ("Change: reset all", None, ResetAll()),
)
_TO_INSPECTORS = ask.ShowWorkspace("inspect"), ask.OpenTab("inspect")
_INSPECTORS: tuple[tuple[str, str | None, Any], ...] = tuple(
    (f"Inspector: {title}", None, (*_TO_INSPECTORS, ask.Set("inspect", "opened", name)))
    for name, (title, _) in INSPECTORS.items()
)
COMMANDS: tuple[tuple[str, str | None, Any], ...] = (
    ("Play or pause", "space", ask.TogglePlay()),
    ("Play or pause ", "K", ask.TogglePlay()),
    ("Previous window", "J", ask.Move(-1)),
    ("Next window", "L", ask.Move(1)),
    ("Back 10 windows", "pageup", ask.Move(-10)),
    ("Forward 10 windows", "pagedown", ask.Move(10)),
    ("First window", "home", ask.Seek(0)),
    ("Last window", "end", ask.Seek(10**9)),
    ("Mark A here", "I", ask.MarkHere("a")),
    ("Mark B here", "O", ask.MarkHere("b")),
    ("Clear marks", "U", ask.ClearMarks()),
    ("Workspace: Inspect", "1", ask.ShowWorkspace("inspect")),
    ("Workspace: Attention", "2", ask.ShowWorkspace("attention")),
    ("Workspace: Compare", "3", ask.ShowWorkspace("compare")),
    ("Workspace: Recording", "4", ask.ShowWorkspace("recording")),
    ("Workspace: Demo", "5", ask.ShowWorkspace("demo")),
    ("Camera: perspective", None, ChooseCamera("orbit")),
    ("Camera: front", "F", ChooseCamera("front")),
    ("Camera: side", None, ChooseCamera("side")),
    *_ATTENTION,
    *_INSPECTORS,
)
