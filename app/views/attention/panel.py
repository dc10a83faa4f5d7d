"""The attention workspace: one site's map large, the atlas of all heads, the shelf, and their settings."""

from __future__ import annotations

import viser

from app.html.elements import card
from app.state import intents as ask
from app.views.attention.html.atlas import atlas_html
from app.views.attention.html.shelf import heads_html, time_html
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.attention.html.tokens import tokens_html
from app.views.attention.state import AttentionState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor


class AttentionPanel(Panel):
    """Five cards, and one column of settings."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One element a card."""
        self._map = Html(gui)
        self._atlas = Html(gui)
        self._heads = Html(gui)
        self._tokens = Html(gui)
        self._time = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Our own choices, and the two that are numbers."""
        self._side = Html(gui)
        self._overlay = gui.add_slider("Opacity", 0.0, 1.0, 0.05, 0.8)
        self._pixel = gui.add_vector2("Pixel x, y", (0.0, 0.0), min=(0.0, 0.0), max=(65_535.0, 65_535.0), step=1.0)
        on_visitor(self._pixel, lambda xy: ask.Query(round(xy[0]), round(xy[1])), dispatch)
        on_visitor(self._overlay, lambda value: ask.Set("attention", "overlay", float(value)), dispatch)

    def show(self, page: Page) -> None:
        """Draw what can be seen of the newest frame that has maps."""
        areas = page.areas
        title, note, tools, body = stage_html(page)
        self._map.show(card("attention.map", title, body, areas, note=note, tools=tools))
        note, tools, body = atlas_html(page)
        self._atlas.show(card("attention.atlas", "All sites, all heads", body, areas, note=note, tools=tools))
        note, tools, body = heads_html(page)
        self._heads.show(card("attention.heads", "Heads", body, areas, note=note, tools=tools))
        title, note, tools, body = tokens_html(page)
        self._tokens.show(card("attention.tokens", title, body, areas, note=note, tools=tools))
        note, tools, body = time_html(page)
        self._time.show(card("attention.time", "Over time", body, areas, note=note, tools=tools))

    def show_settings(self, page: Page) -> None:
        """Set the choices to what is so."""
        if page.state.query is not None:
            assign(self._pixel, (float(page.state.query[0]), float(page.state.query[1])))
        assign(self._overlay, page.state.of(AttentionState).overlay)
        self._side.show(side_html(page))
