"""The live source: where it is, what was lost, its settings, and recording it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.live.state import LiveState, hear, perform
from app.views.view import EXPERT, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.live.panel import LivePanel

    return LivePanel()


VIEW = View("live", "Live", "VIDEO", LiveState(), _panel, settings_in=EXPERT, hear=hear, perform=perform)
