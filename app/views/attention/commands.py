"""What the palette can do with the map, its query and its pins."""

from __future__ import annotations

from app.state import intents as ask
from app.views.attention.state import Compare, PinMap, StepHead, StepSite, Unpin
from app.views.view import Command

_TOKEN = 8
"""Pixels on its side."""
COMMANDS = (
    Command("Attention: next site", None, StepSite(1)),
    Command("Attention: previous site", None, StepSite(-1)),
    Command("Attention: next head", None, StepHead(1)),
    Command("Attention: previous head", None, StepHead(-1)),
    Command("Attention: all heads", None, ask.Set("attention", "head", None)),
    Command("Attention: query a token to the left", None, ask.MoveQuery(-_TOKEN, 0)),
    Command("Attention: query a token to the right", None, ask.MoveQuery(_TOKEN, 0)),
    Command("Attention: query a token up", None, ask.MoveQuery(0, -_TOKEN)),
    Command("Attention: query a token down", None, ask.MoveQuery(0, _TOKEN)),
    Command("Attention: follow the patch under the pixel", None, ask.Set("attention", "follows", True)),
    Command("Attention: stay at the pixel", None, ask.Set("attention", "follows", False)),
    Command("Attention: pin this map as A", None, PinMap("a")),
    Command("Attention: pin this map as B", None, PinMap("b")),
    Command("Attention: compare with A", None, Compare("a")),
    Command("Attention: compare with B", None, Compare("b")),
    Command("Attention: compare with nothing", None, Compare("none")),
    Command("Attention: unpin A", None, Unpin("a")),
    Command("Attention: unpin B", None, Unpin("b")),
)
