"""The demo's page: its pictures, and the bar of what a visitor can do."""

from __future__ import annotations

import viser

from app.views.demo.html import bar_html, caption_html, compact_html, demo_html
from app.views.demo.state import DemoState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel

PHONE_ASPECT = 0.9
"""A canvas narrower than this is a phone's."""


class DemoPanel(Panel):
    """Buttons are an element of their own: pictures come and go below them."""

    def __init__(self, client: viser.ClientHandle) -> None:
        self._is_phone = client.camera.aspect < PHONE_ASPECT

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """The bar, then the pictures."""
        self._bar = Html(gui)
        self._pictures = Html(gui)

    def show(self, page: Page) -> None:
        """Draw what the act points at."""
        act = page.state.of(DemoState).act
        public = f'<i data-etv-public="{act}"></i>' if page.state.is_public else ""
        bar = compact_html(page) if self._is_phone else bar_html(page) + caption_html(act)
        self._bar.show(f'<section class="etv-demo-bar">{public}{bar}</section>')
        self._pictures.show(demo_html(page))
