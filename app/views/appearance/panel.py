"""The bar above the page, and the tab of how pictures are drawn."""

from __future__ import annotations

import viser

from app.state import intents as ask
from app.views.appearance.html import bar_html, display_html
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from app.views.scene.state import SceneState


class AppearancePanel(Panel):
    """The bar is one element; it is sent only when something in it changes."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The bar."""
        self._bar = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """How pictures are drawn."""
        self._display = Html(gui)
        self._events = gui.add_checkbox("Events in the scene", True)
        on_visitor(self._events, lambda value: ask.Set("scene", "shows_events", bool(value)), dispatch)

    def show(self, page: Page) -> None:
        """Say what is open and how it was made."""
        self._bar.show(bar_html(page))

    def show_settings(self, page: Page) -> None:
        """Set the choices to what is so."""
        self._display.show(display_html(page))
        assign(self._events, page.state.of(SceneState).shows_events)
