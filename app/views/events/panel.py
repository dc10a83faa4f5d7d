"""All events of the window in one image."""

from __future__ import annotations

import viser

from app.html.elements import card, empty, panel
from app.html.moment import newest_of
from app.html.pictures import event_image_html
from app.html.units import count, milliseconds
from app.views.events.state import EventsState
from app.views.page import Page
from app.views.panel import Dispatch, Html, Panel


class EventsPanel(Panel):
    """The image alone."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """One card."""
        self._events = Html(gui)

    def show(self, page: Page) -> None:
        """Draw the moment; without one, say why."""
        moment = page.moment
        if moment is None:
            nothing = panel("events", empty("No recording", page.trouble or "Choose one in the bar."))
            self._events.show(card("events", "Events", nothing, page.areas))
            return
        if page.follows:
            moment = newest_of(moment)
        window = moment.window
        note = f"{count(window.num_events)} in {milliseconds((window.t_stop - window.t_start) / 1000)}"
        body = event_image_html(moment, page.state.of(EventsState).event_image)
        self._events.show(card("events", "Events", body, page.areas, note=note))
