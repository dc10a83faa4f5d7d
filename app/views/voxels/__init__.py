"""The voxel grid that the network is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.views.view import Card, View
from app.views.voxels.state import VoxelsState

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


def _panel(client: viser.ClientHandle) -> Panel:
    from app.views.voxels.panel import VoxelsPanel

    return VoxelsPanel()


VIEW = View(
    "voxels",
    "Voxel grid",
    "GRID_DOTS",
    VoxelsState(),
    _panel,
    workspaces=frozenset({"inspect", "recording"}),
    cards=(Card("voxels", shelf=frozenset({"inspect", "recording"})),),
    is_public=True,
)
