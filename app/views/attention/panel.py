"""The maps of the chosen pixel: one site large, and the atlas of all sites."""

from __future__ import annotations

import viser

from app.html.attention.look import MapRange
from app.html.card import card
from app.state import intents as ask
from app.views.attention.html.grid import attention_html, site_html
from app.views.attention.html.tools import attention_tools_html, pinned_html
from app.views.attention.state import AttentionState, look_of
from app.views.inspect.state import InspectState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor

RANGES: dict[MapRange, str] = {"shared": "shared", "per map": "per map"}


class AttentionPanel(Panel):
    """Two cards, and how their maps are coloured."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The chosen site's map with its heads, and all sites."""
        self._map = Html(gui)
        self._atlas = Html(gui)

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Pixel, pinned maps, how heads are gathered and maps are drawn."""
        self._pixel = gui.add_vector2("Pixel x, y", (0.0, 0.0), min=(0.0, 0.0), max=(65_535.0, 65_535.0), step=1.0)
        self._pinned = Html(gui)
        self._tools = Html(gui)
        self._range = gui.add_dropdown("Colour range", tuple(RANGES.values()))
        self._overlay = gui.add_slider("Opacity", 0.0, 1.0, 0.05, 0.8)
        words: dict[str, MapRange] = {text: name for name, text in RANGES.items()}
        on_visitor(self._pixel, lambda xy: ask.Query(round(xy[0]), round(xy[1])), dispatch)
        on_visitor(self._range, lambda text: ask.Set("attention", "map_range", words[text]), dispatch)
        on_visitor(self._overlay, lambda value: ask.Set("attention", "overlay", float(value)), dispatch)

    def show(self, page: Page) -> None:
        """Draw the maps of the newest frame that has them."""
        slice_, look, index = page.state.of(AttentionState), look_of(page), page.state.index
        waits = {"wanted": index, "working": page.working, "failed": page.failed}
        title, body = site_html(page.ready, look, slice_.site, **waits)
        self._map.show(card("attention.map", title, body, page.areas))
        body = attention_html(page.ready, look, chosen=slice_.site, **waits)
        self._atlas.show(card("attention.atlas", "All sites", body, page.areas))

    def show_settings(self, page: Page) -> None:
        """Set the widgets to what is so; the tools speak of the chosen site."""
        state, slice_, look = page.state, page.state.of(AttentionState), look_of(page)
        if state.query is not None:
            assign(self._pixel, (float(state.query[0]), float(state.query[1])))
        assign(self._range, RANGES[slice_.map_range])
        assign(self._overlay, slice_.overlay)
        has_maps = page.ready is not None and page.ready.attention is not None and bool(page.ready.attention.sites)
        drawn = look if has_maps else None
        self._pinned.show(pinned_html(page.ready, drawn, slice_))
        change = state.of(InspectState).change
        self._tools.show(attention_tools_html(slice_, change.intervention, drawn, site=slice_.site))
