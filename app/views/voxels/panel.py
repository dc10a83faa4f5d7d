"""The voxel grid that the network is given."""

from __future__ import annotations

import viser

from app.html.elements import card
from app.html.moment import NUM_BINS
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel
from app.views.voxels.html import voxel_html
from app.views.voxels.state import VoxelsState


class VoxelsPanel(Panel):
    """Five tiles; a click enlarges one."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One card."""
        self._voxels = Html(gui)

    def show(self, page: Page) -> None:
        """Draw the bins of the moment."""
        body = "" if page.moment is None else voxel_html(page.moment, page.state.of(VoxelsState).voxel_bin)
        note = f"network input, {NUM_BINS} bins"
        self._voxels.show(card("voxels", "Voxel grid", body, page.areas, note=note))
