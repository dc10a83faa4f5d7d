"""All events of the window in one image."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.events.state import EventsState
from app.views.view import Card, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.events.panel import EventsPanel

    return EventsPanel()


VIEW = View(
    "events",
    "Events",
    "SPARKLES",
    EventsState(),
    _panel,
    workspaces=frozenset({"inspect", "recording"}),
    cards=(Card("events", shelf=frozenset({"inspect", "recording"})),),
    is_public=True,
)
