"""What lies in a visitor's mailbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.engine.requests import Reply
from app.session.jobs import JobNews
from app.session.loader import Opened, Opening, Unopened
from app.session.runs import RunPlanned, RunReply


@dataclass(frozen=True, slots=True)
class CanvasChanged:
    """The canvas has another shape; the camera must be placed again."""


@dataclass(frozen=True, slots=True)
class HandedOver:
    """News of the files that the visitor uploads; `arrived` is the id of one that can be opened now, or ""."""

    arrived: str


@dataclass(frozen=True, slots=True)
class Presented:
    """The page that leads a presentation has moved, or another one leads."""


@dataclass(frozen=True, slots=True)
class Closed:
    """The visitor has gone."""


News = Reply | JobNews | RunPlanned | RunReply | Opening | Opened | Unopened
Item = Any
"""An intent, or a message: `Hello`, `Resized`, `RemoveFile`, `HandedOver`, `CanvasChanged`, `Closed`, news …"""
