"""What the network makes of the events, beside what an ordinary camera saw."""

from __future__ import annotations

import viser

from app.html.elements import card
from app.html.pictures import camera_frame_html
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel
from app.views.reconstruction.html import shown_html, tools_html
from app.views.reconstruction.state import tones_of


class ReconstructionPanel(Panel):
    """Two cards; a click on either picture chooses a pixel."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One element a card."""
        self._reconstruction = Html(gui)
        self._camera = Html(gui)

    def show(self, page: Page) -> None:
        """Draw the newest frame and the camera's nearest one."""
        tools = tools_html(page) if page.areas.get("reconstruction") in ("a", "b") else ""
        self._reconstruction.show(card("reconstruction", "Reconstruction", shown_html(page), page.areas, tools=tools))
        title = "Camera" if page.video is None else "Video"
        if page.moment is None:
            self._camera.show(card("camera", title, "", page.areas))
            return
        self._camera.show(card("camera", title, camera_frame_html(page.moment, tones=tones_of(page)), page.areas))
