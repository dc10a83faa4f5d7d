"""What belongs to no column: the strip of provenance, the scene's legend, the demo's three large pictures."""

from __future__ import annotations

from html import escape

import viser

from app.html.pictures import camera_frame_html, event_image_html
from app.html.provenance import provenance_html
from app.html.units import resolution
from app.session.channel import ON_PICK
from app.views.attention.html.grid import sites_behind
from app.views.attention.html.links import LINK_COLOURS, link_words, links_of
from app.views.attention.html.maps import Site, site_words
from app.views.demo.public import caption_html, compact_html
from app.views.reconstruction.panel import reconstruction
from app.views.scene.points import EventCloud
from app.views.view import Dispatch, Html, Page
from etnet.render.colours import OFF, ON, hexadecimal

_HELP = f'<span><button class="etv-help-button" data-k="help" {ON_PICK} title="Keys and words">?</button></span>'

_WAY_BACK = f'<span><button class="etv-home-button" data-k="workspace:demo" {ON_PICK}>Back to the demo</button></span>'


class Provenance:
    """File, sensor, network, precision, windows, speed, density, exactness: one line."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """It is placed into the title bar by the theme."""
        self._strip = Html(gui)

    def show(self, page: Page) -> None:
        """Say what is on show and how it was made."""
        if page.moment is None:
            self._strip.show(_HELP)
            return
        way_back = _WAY_BACK if page.state.show.is_demo and page.state.workspace != "demo" else ""
        strip = provenance_html(page.moment, page.model, page.ready, page.step_milliseconds)
        self._strip.show(f'<div class="etv-provenance">{strip}</div>{way_back}{_HELP}')


class SceneLegend:
    """What the two hues mean, how many of the events are drawn, which workspace the page is in.

    On a phone, where nothing else stands above the scene, also the way to the help, and the demo's own controls.
    """

    def __init__(self, is_phone: bool = False) -> None:
        self._is_phone = is_phone

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """It is placed over the scene by the theme."""
        self._legend = Html(gui)
        self._cloud: EventCloud | None = None

    def tell(self, cloud: EventCloud | None) -> None:
        """The cloud that stands in the scene."""
        self._cloud = cloud

    def show(self, page: Page) -> None:
        """Also the mark by which the theme knows the workspace."""
        mark = f'<i data-etv-workspace="{page.state.workspace}" data-etv-moment="{page.link}"></i>'
        if self._is_phone:
            mark += _HELP
        if page.state.show.is_demo:
            act = page.state.show.act
            mark += f'<i data-etv-public="{act}"></i>{compact_html(page) if self._is_phone else caption_html(act)}'
        if page.state.workspace == "attention":
            self._legend.show(mark + _over_scene(_map_words(page) + _link_words(page)))
            return
        cloud = self._cloud
        if page.moment is None or cloud is None:
            self._legend.show(mark + _over_scene(_plane_words(page) + _link_words(page)))
            return
        drawn = f"{len(cloud.positions):,} of {cloud.num_events:,} events" if cloud.is_thinned else "all events drawn"
        hues = ("made the pixel brighter", "made it darker") if cloud.is_traced else ("brighter (ON)", "darker (OFF)")
        swatches = "".join(
            f'<span class="et-swatch"><i style="background:{hexadecimal(hue)}"></i>{words}</span>'
            for hue, words in zip((ON, OFF), hues, strict=True)
        )
        note = f'<span class="et-note">{drawn} · the newest lie at the picture</span>'
        self._legend.show(mark + _over_scene(swatches + note + _link_words(page)))


class Demo:
    """Three equally large pictures in plain words."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The theme lets it fill the page."""
        self._pictures = Html(gui)

    def show(self, page: Page) -> None:
        """Nothing is drawn while another workspace is on show."""
        if page.state.workspace != "demo" or page.moment is None:
            self._pictures.show('<div class="etv-demo"></div>')
            return
        shown = [
            ("Changes the sensor reported", event_image_html(page.moment, page.state.event_image)),
            ("Image the network makes of them", reconstruction(page, is_plain=True)),
        ]
        if page.moment.recording.ground_truth is not None:
            shown.append(("Ordinary camera", camera_frame_html(page.moment, tones=page.tones)))
        figures = "".join(f"<figure><h2>{title}</h2>{content}</figure>" for title, content in shown)
        self._pictures.show(f'<div class="etv-demo" style="--figures:{len(shown)}" data-testid="demo">{figures}</div>')


def _map_words(page: Page) -> str:
    attention = page.ready.attention if page.ready is not None else None
    if attention is None or page.look is None or page.state.site not in attention.sites:
        return ""
    words = site_words(page.state.site, attention.sites)
    head = "mean of all heads" if page.state.head is None else f"head {page.state.head + 1}"
    return f'<span>{escape(words)}</span><span class="et-note">{head}</span>'


def _plane_words(page: Page) -> str:
    sites = sites_behind(page.ready, page.look, page.state)
    behind = ", ".join(resolution(Site.of(site).scale) for site in sites)
    return f"<span>behind the image: what this layer reads at {behind}</span>" if sites else ""


def _link_words(page: Page) -> str:
    if not page.state.inside.shows_links:
        return ""
    links = links_of(page.ready, page.state.query)
    return "".join(
        f'<span class="et-swatch"><i style="background:{hexadecimal(LINK_COLOURS[scale])}"></i>'
        f"{link_words(links, scale)}</span>"
        for scale in dict.fromkeys(link.scale for link in links)
    )


def _over_scene(content: str) -> str:
    return f'<div class="et etv-scene-legend" data-testid="scene-legend">{content}</div>' if content else ""
