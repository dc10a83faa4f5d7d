"""The tab of the filter."""

from __future__ import annotations

import viser

from app.views.filter.html import filter_html
from app.views.filter.why import why_html
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel


class FilterPanel(Panel):
    """Two elements: what is taken out, and why this frame is bad."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The filter, then the findings."""
        self._filter = Html(gui)
        self._why = Html(gui)

    def show_settings(self, page: Page) -> None:
        """Set the buttons to what is so."""
        self._filter.show(filter_html(page))
        self._why.show(why_html(page))
