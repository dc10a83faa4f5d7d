"""The demo's page: sentence, pictures, slider and buttons, and what lies over them."""

from __future__ import annotations

import viser

from app.views.demo.html import foot_html, lead_html, pictures_html
from app.views.demo.sheets import mirror_html, sheet_html
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel


class DemoPanel(Panel):
    """Each part is an element of its own, so that a slider stays while pictures come and go."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """From the top down; the large picture is the scene's card, or the map."""
        self._lead = Html(gui)
        self._pictures = Html(gui)
        self._foot = Html(gui)
        self._mirror = Html(gui)
        self._sheet = Html(gui)

    def show(self, page: Page) -> None:
        """Draw what the act, or the visitor, points at."""
        self._lead.show(lead_html(page))
        self._pictures.show(pictures_html(page))
        self._foot.show(foot_html(page))
        self._mirror.show(mirror_html(page))
        self._sheet.show(sheet_html(page))
