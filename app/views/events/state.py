"""How the window's events are drawn as one image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from etnet.render.events import EventStyle


@dataclass(frozen=True, slots=True)
class EventsState:
    """One visitor's event image."""

    view: ClassVar[str] = "events"
    event_image: EventStyle = "polarity"
