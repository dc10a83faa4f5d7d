"""The recording in time: what is cached, what is playing, where the moment is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.timeline.state import TimelineState, hear
from app.views.view import EXPERT, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.timeline.panel import TimelinePanel

    return TimelinePanel()


VIEW = View(
    "timeline",
    "Timeline",
    "TIMELINE",
    TimelineState(),
    _panel,
    workspaces=EXPERT,
    at_foot=True,
    is_public=True,
    hear=hear,
)
