"""The event cloud as a card like the others: viser's canvas lies over its slot."""

from __future__ import annotations

import viser

from app.html.attention.links import LINK_COLOURS, link_words, links_of
from app.html.attention.maps import Site
from app.html.elements import card, icon_button, swatch
from app.html.pictures import EventCloud
from app.html.units import resolution
from app.views.attention.state import AttentionState
from app.views.demo.state import opens_cloud
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel
from app.views.scene.scene import SceneView, sites_behind
from app.views.scene.state import Camera, SceneState
from etnet.render.colours import OFF, ON, hexadecimal

_CAMERAS: tuple[tuple[Camera, str, str], ...] = (
    ("orbit", "cube", "Perspective"),
    ("front", "front", "Front"),
    ("side", "side", "Side"),
)


class ScenePanel(Panel):
    """The card's frame, and the scene that is drawn into it."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._client = client

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The page's script lays the canvas over `.etv-scene-slot`."""
        self._frame = Html(gui)
        self._scene = SceneView(self._client, dispatch)

    def show(self, page: Page) -> None:
        """Draw the scene, then what its colours mean; the next picture of a drag will do where this one is left out."""
        if not page.draws_scene:
            return
        is_covered = page.state.workspace == "demo" and not opens_cloud(page.state)
        cloud = None if is_covered else self._scene.show(page)  # the map stands in its place
        chosen = page.state.of(SceneState).camera
        tools = "".join(
            icon_button(f"scene:camera:{name}", icon, words, is_on=name == chosen) for name, icon, words in _CAMERAS
        )
        slot = '<div class="etv-scene-slot"></div>'
        if page.state.workspace == "demo":
            self._frame.show(_in_public(page, slot))
            return
        self._frame.show(card("scene", "Event cloud", slot, page.areas, note=_legend(page, cloud), tools=tools))


def _in_public(page: Page, slot: str) -> str:
    """The large picture of the demo, in plain words; out of the way while the map stands in its place."""
    hues = swatch(hexadecimal(ON), "brighter") + swatch(hexadecimal(OFF), "darker")
    areas = page.areas if opens_cloud(page.state) else {}
    return card("scene", "Changes the sensor reported", slot, areas, note=hues)


def _legend(page: Page, cloud: EventCloud | None) -> str:
    parts = []
    if cloud is not None:
        words = ("made the pixel brighter", "made it darker") if cloud.is_traced else ("ON", "OFF")
        parts += [swatch(hexadecimal(hue), text) for hue, text in zip((ON, OFF), words, strict=True)]
        if cloud.is_thinned:
            parts.append(f"<span>{len(cloud.positions):,} of {cloud.num_events:,}</span>")
    if sites := sites_behind(page):
        behind = ", ".join(resolution(Site.of(site).scale) for site in sites)
        parts.append(f"<span>behind the image: this layer at {behind}</span>")
    if page.state.of(AttentionState).shows_links:
        links = links_of(page.ready, page.state.query)
        parts += [
            swatch(hexadecimal(LINK_COLOURS[scale]), link_words(links, scale))
            for scale in dict.fromkeys(link.scale for link in links)
        ]
    return f'<span data-testid="scene-legend">{"".join(parts)}</span>'
