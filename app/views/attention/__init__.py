"""Where the network looks from the chosen pixel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.attention.state import AttentionState, hear, reduce_attention
from app.views.view import Card, View

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.attention.panel import AttentionPanel

    return AttentionPanel()


VIEW = View(
    "attention",
    "Attention",
    "FOCUS_2",
    AttentionState(),
    _panel,
    workspaces=frozenset({"attention"}),
    settings_in=frozenset({"attention"}),
    cards=(
        Card("attention.map", stage=frozenset({"attention"})),
        Card("attention.atlas", stage=frozenset({"attention"})),
    ),
    is_public=True,
    reduce=reduce_attention,
    hear=hear,
)
