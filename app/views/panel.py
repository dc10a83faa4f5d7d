"""What every panel is, and its widgets: their use turns into intents, their content is sent only when it changes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import viser
from viser._messages import GuiUpdateMessage

from app.views.page import Page
from etnet.errors import EtnetError

Dispatch = Callable[[Any], None]
"""Takes an intent; returns at once."""


class Panel:
    """The widgets of a view. A page builds it once; what it cannot show is never asked of it."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Lay out what stands in the page itself, once."""

    def build_settings(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Lay out its tab of the inspector column, once."""

    def show(self, page: Page) -> None:
        """Draw what has changed in the page. Called from the visitor's own thread."""

    def show_settings(self, page: Page) -> None:
        """Draw what has changed in the tab, while it is open."""


class Html:
    """One HTML element; it is sent only when it differs from what the page already has."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._handle = gui.add_html(content)
        self._content = content

    def show(self, content: str) -> None:
        """Replace the content in place."""
        if content != self._content:
            self._content = content
            self._handle.content = content

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide the element."""
        if self._handle.visible != is_visible:
            self._handle.visible = is_visible


def on_visitor(handle: Any, act: Callable[[Any], Any], dispatch: Dispatch) -> None:
    """Turn a visitor's use of a widget into an intent; what the server itself assigns is none.

    `act` gets the widget's value. It runs on viser's event loop and must only make a value.
    """

    async def heard(event: viser.GuiEvent[Any]) -> None:
        if event.client is None:
            return
        try:
            intent = act(event.target.value)
        except (TypeError, ValueError, LookupError, OverflowError, EtnetError):
            return  # no widget of ours sends such a value
        if intent is not None:
            dispatch(intent)

    handle.on_update(heard)
    handle._impl.update_timestamp = 0.0  # viser counts a new widget as touched


def on_press(button: viser.GuiButtonHandle, intent: Any, dispatch: Dispatch) -> None:
    """Turn a visitor's click into an intent."""

    async def pressed(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            dispatch(intent)

    button.on_click(pressed)


def assign(handle: Any, value: object) -> None:
    """Let a widget show a value, unless it does, or the visitor's hand was on it a moment ago."""
    if handle.value != value and seconds_since_touched(handle) > 0.4:
        set_value(handle, value)


def set_value(handle: Any, value: object) -> None:
    """Let a widget show a value. No listener is told, and it does not count as touched: it is no visitor's use.

    viser's own setter makes a coroutine of every listener, from whichever thread sets; where the server ends just
    then, nobody awaits it.
    """
    inner = handle._impl
    if inner.value == value:
        return
    inner.value = type(inner.value)(value)
    inner.gui_api._websock_interface.queue_message(GuiUpdateMessage(inner.uuid, {"value": inner.value}))


def set_options(handle: Any, options: tuple[str, ...], value: str) -> None:
    """Offer these, `value` where the present one is none of them; viser's setter alone would wake every listener."""
    if handle.value not in options:
        set_value(handle, value)
    handle.options = options


def seconds_since_touched(handle: Any) -> float:
    """Seconds since a visitor last changed the widget's value."""
    return time.time() - float(handle.update_timestamp)
