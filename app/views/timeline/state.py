"""The moment is shared by all views; the strip keeps nothing of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True, slots=True)
class TimelineState:
    """The moment is shared by all views; the strip keeps nothing of its own."""

    view: ClassVar[str] = "timeline"
