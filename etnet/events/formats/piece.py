"""One of the numbered files of a recording, whatever container it is in."""

from __future__ import annotations

from dataclasses import dataclass

from etnet.events.events import Sensor
from etnet.events.formats.column_finder import Found
from etnet.events.formats.frames import Frames


@dataclass(frozen=True)
class Piece:
    """Its columns, and what it says of the sensor and of the clock: `offset` (µs) is added to its stamps."""

    found: Found
    sensor: Sensor | None = None
    offset: int = 0
    frames: Frames | None = None
    """Its pictures, which can be read as long as the file is open."""
