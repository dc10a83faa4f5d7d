"""The choice of event image."""

from __future__ import annotations

from app.html.card import segmented
from app.views.events.state import EventsState
from app.views.page import Page
from etnet.render.events import EventStyle

STYLES: dict[EventStyle, str] = {
    "polarity": "polarity",
    "count": "count",
    "time surface": "time surface",
    "decay": "decay",
}


def style_html(page: Page) -> str:
    """The choice of event image."""
    options = {f"set:events.event_image:{name}": words for name, words in STYLES.items()}
    return segmented("Event image", options, f"set:events.event_image:{page.state.of(EventsState).event_image}")
