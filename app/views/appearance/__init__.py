"""The bar above the page, and how pictures are drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.appearance.state import AppearanceState
from app.views.view import EVERYWHERE, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.appearance.panel import AppearancePanel

    return AppearancePanel()


VIEW = View(
    "appearance",
    "Display",
    "ADJUSTMENTS_HORIZONTAL",
    AppearanceState(),
    _panel,
    workspaces=EVERYWHERE,
    settings_in=frozenset({"inspect", "attention", "compare"}),
    is_public=True,
)
