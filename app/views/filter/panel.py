"""The tab of the filter."""

from __future__ import annotations

import viser

from app.views.filter.html import filter_html
from app.views.filter.why import why_html
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel


class FilterPanel(Panel):
    """Two elements: why this frame is bad, and what is taken out."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The findings, then the filter."""
        self._why = Html(gui)
        self._filter = Html(gui)

    def show_settings(self, page: Page) -> None:
        """Set the buttons to what is so."""
        self._filter.show(filter_html(page))
        self._why.show(why_html(page))
