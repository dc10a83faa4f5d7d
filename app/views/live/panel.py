"""The tab of the live source: what it is, recording, and one slider for each of its settings."""

from __future__ import annotations

from typing import Any

import viser

from app.views.live.html import recording_html, source_html
from app.views.live.state import ChangeSetting
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from etnet.live.source import Setting

MOST_SETTINGS = 40


class LivePanel(Panel):
    """Sliders are made when the source first tells its settings, and only where the visitor may change them."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """What it is, then its settings."""
        self._gui, self._dispatch = gui, dispatch
        self._recording = Html(gui)
        self._source = Html(gui)
        self._folder = gui.add_folder("Biases and other settings", expand_by_default=False, visible=False)
        self._sliders: dict[str, Any] = {}

    def show_settings(self, page: Page) -> None:
        """Draw what is so now."""
        self._source.show(source_html(page))
        self._recording.show(recording_html(page))
        settings = page.live.settings[:MOST_SETTINGS] if page.live is not None and page.live.may_change else ()
        if bool(settings) != self._folder.visible:
            self._folder.visible = bool(settings)
        for setting in settings:
            if setting.name not in self._sliders:
                self._sliders[setting.name] = self._slider(setting)
            assign(self._sliders[setting.name], setting.value)

    def _slider(self, setting: Setting) -> Any:
        name = setting.name
        with self._folder:
            slider = self._gui.add_slider(
                name.replace("_", " "), setting.minimum, max(setting.maximum, setting.minimum + 1), 1,
                min(max(setting.value, setting.minimum), setting.maximum),
            )  # fmt: skip
        on_visitor(slider, lambda value: ChangeSetting(name, int(value)), self._dispatch)
        return slider
