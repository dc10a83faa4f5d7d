"""The tab of the live source: what it is, recording, and one widget for each of its settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import viser

from app.catalogue.live import LiveShown
from app.views.live.html import recording_html, source_html
from app.views.live.state import ChangeSetting, FollowRate
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel, assign, on_visitor
from etnet.live.source import Setting

MOST_SETTINGS = 40
LONGEST_SLIDER = 5_000
"""Values of a slider; a wider range is a number that is typed."""
RATE = (0.5, 3.0)
"""Mev/s that are offered to biases that follow."""


@dataclass(slots=True)
class _RateWidgets:
    """Biases that follow: a switch, and the rates between which nothing is changed."""

    is_on: Any
    lowest: Any
    highest: Any

    def show(self, followed: tuple[float, float] | None) -> None:
        """What is so now; rates that were typed stay while nothing follows them."""
        assign(self.is_on, followed is not None)
        if followed is not None:
            assign(self.lowest, followed[0])
            assign(self.highest, followed[1])


class LivePanel(Panel):
    """Widgets are made when the source first tells its settings, and only where the visitor may change them."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """What it is, then its settings."""
        self._gui, self._dispatch = gui, dispatch
        self._recording = Html(gui)
        self._source = Html(gui)
        self._folder = gui.add_folder("Biases and other settings", expand_by_default=False, visible=False)
        self._widgets: dict[str, Any] = {}
        self._rate: _RateWidgets | None = None

    def show_settings(self, page: Page) -> None:
        """Draw what is so now."""
        self._source.show(source_html(page))
        self._recording.show(recording_html(page))
        live = page.live if page.live is not None and page.live.may_change else None
        settings = () if live is None else live.settings[:MOST_SETTINGS]
        if bool(settings) != self._folder.visible:
            self._folder.visible = bool(settings)
        if live is not None and live.can_follow:
            self._show_rate(live)
        for setting in settings:
            if setting.name not in self._widgets:
                with self._folder:
                    self._widgets[setting.name] = self._widget(setting)
            assign(self._widgets[setting.name], _value_of(setting))

    def _show_rate(self, live: LiveShown) -> None:
        if self._rate is None:
            with self._folder:
                lowest, highest = live.followed or RATE
                self._rate = rate = _RateWidgets(
                    self._gui.add_checkbox("biases follow the event rate", initial_value=live.followed is not None),
                    self._gui.add_number("at least (Mev/s)", initial_value=lowest, min=0.0, max=1_000.0, step=0.1),
                    self._gui.add_number("at most (Mev/s)", initial_value=highest, min=0.1, max=1_000.0, step=0.1),
                )
            for widget in (rate.is_on, rate.lowest, rate.highest):
                on_visitor(widget, lambda _: _wish(rate), self._dispatch)
        self._rate.show(live.followed)

    def _widget(self, setting: Setting) -> Any:
        name, label, now = setting.name, _label(setting.name), _value_of(setting)
        if setting.is_switch:
            widget = self._gui.add_checkbox(label, initial_value=bool(now))
        elif setting.choices:
            widget = self._gui.add_dropdown(label, setting.choices, initial_value=str(now))
        elif setting.maximum - setting.minimum > LONGEST_SLIDER:
            widget = self._gui.add_number(
                label, initial_value=int(now), min=setting.minimum, max=setting.maximum, step=1
            )
        else:
            highest = max(setting.maximum, setting.minimum + 1)
            widget = self._gui.add_slider(label, setting.minimum, highest, 1, initial_value=int(now))
        on_visitor(widget, lambda value: ChangeSetting(name, _number_of(setting, value)), self._dispatch)
        return widget


def _label(name: str) -> str:
    """Without its group, which stands above it: "exposure (µs)" of exposure_us."""
    words = name.rpartition(".")[2].replace("_", " ")
    return f"{words.removesuffix(' us')} (µs)" if words.endswith(" us") else words


def _value_of(setting: Setting) -> int | bool | str:
    """As its widget shows it."""
    if setting.is_switch or setting.choices:
        return setting.plain
    return min(max(setting.value, setting.minimum), setting.maximum)


def _number_of(setting: Setting, value: Any) -> int:
    """What a widget says. Raises ValueError for a choice that is none."""
    return setting.choices.index(value) if setting.choices else int(value)


def _wish(rate: _RateWidgets) -> FollowRate:
    return FollowRate(bool(rate.is_on.value), float(rate.lowest.value), float(rate.highest.value))
