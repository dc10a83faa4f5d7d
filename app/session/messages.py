"""What lies in a visitor's mailbox."""

from __future__ import annotations

from dataclasses import dataclass

from app.engine.requests import Reply
from app.session.channel import Hello, RemoveFile, Resized
from app.session.jobs import JobNews
from app.session.lanes import LanePlanned, LaneReply
from app.session.opening import Opened, Opening, Unopened
from app.session.visit import Shown
from app.state import intents as ask


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


News = Reply | JobNews | LanePlanned | LaneReply | Opening | Opened | Unopened
Item = ask.Intent | Hello | Resized | Shown | RemoveFile | HandedOver | News | CanvasChanged | Closed
