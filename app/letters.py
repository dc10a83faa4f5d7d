"""What lies in a visitor's mailbox."""

from __future__ import annotations

from dataclasses import dataclass

from app import intents as ask
from app.channel import Hello, RemoveFile, Resized
from app.comparing import LanePlanned, LaneReply
from app.opening import Opened, Opening, Unopened
from app.showing import Shown
from app.studying import Found
from app.wishes import Reply


@dataclass(frozen=True, slots=True)
class CanvasChanged:
    """The canvas has another shape; the camera must be placed anew."""


@dataclass(frozen=True, slots=True)
class HandedOver:
    """News of the files that the visitor hands over; `arrived` is the id of one that can be opened now, or ""."""

    arrived: str


@dataclass(frozen=True, slots=True)
class Closed:
    """The visitor has gone."""


News = Reply | Found | LanePlanned | LaneReply | Opening | Opened | Unopened
Item = ask.Intent | Hello | Resized | Shown | RemoveFile | HandedOver | News | CanvasChanged | Closed
