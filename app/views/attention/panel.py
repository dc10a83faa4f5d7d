"""Where the network looks from the chosen pixel: all sites in a grid, or one site's heads."""

from __future__ import annotations

import viser

from app.session.channel import ON_PICK
from app.state import intents as ask
from app.views.attention.html.grid import attention_html
from app.views.attention.html.tools import attention_tools_html, pinned_html
from app.views.view import Dispatch, Html, Page, assign, on_visitor

RANGES: dict[ask.MapRange, str] = {"shared": "one scale for all maps", "per map": "each map its own"}


class AttentionPanel:
    """The maps, and how they are coloured."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Maps first; the few settings stand below them."""
        self._pixel = gui.add_vector2("Pixel x, y", (0.0, 0.0), min=(0.0, 0.0), max=(65_535.0, 65_535.0), step=1.0)
        self._pinned = Html(gui)
        self._maps = Html(gui)
        self._tools = Html(gui)
        self._range = gui.add_dropdown("Colours", tuple(RANGES.values()))
        self._overlay = gui.add_slider("Strength", 0.0, 1.0, 0.05, 0.8)
        words: dict[str, ask.MapRange] = {text: name for name, text in RANGES.items()}
        on_visitor(self._pixel, lambda xy: ask.Query(round(xy[0]), round(xy[1])), dispatch)
        on_visitor(self._range, lambda text: ask.ChooseMapRange(words[text]) if text in words else None, dispatch)
        on_visitor(self._overlay, ask.SetOverlay, dispatch)

    def show(self, page: Page) -> None:
        """Draw the maps of the newest frame that has them."""
        state = page.state
        if state.query is not None:
            assign(self._pixel, (float(state.query[0]), float(state.query[1])))
        assign(self._range, RANGES[state.map_range])
        assign(self._overlay, state.overlay)
        opened = state.site if state.opens_heads else None
        has_maps = page.ready is not None and page.ready.attention is not None and bool(page.ready.attention.sites)
        look = page.look if has_maps else None
        self._pinned.show(pinned_html(page.ready, look, state.inside, ON_PICK))
        self._tools.show(attention_tools_html(state.inside, look, site=opened, on_pick=ON_PICK))
        self._maps.show(
            attention_html(
                page.ready,
                page.look,
                wanted=state.index,
                opened=opened,
                on_pick=ON_PICK,
            )
        )
