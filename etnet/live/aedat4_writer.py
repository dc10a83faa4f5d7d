"""Write what comes live as AEDAT 4, so that a kill costs the last packet at most."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from etnet.events.events import Sensor
from etnet.events.writers.aedat4 import Aedat4File
from etnet.live.source import CameraFrame, Setting, as_json


class Aedat4Writer(Aedat4File):
    """Appends packets as they come."""

    def __init__(self, path: Path, sensor: Sensor, source: str, settings: Sequence[Setting] = ()) -> None:
        """`settings`: the source's as they are now; the header says them as JSON."""
        super().__init__(path, sensor, {"source": source, **({"settings": as_json(settings)} if settings else {})})

    def add_frame(self, frame: CameraFrame, num_before: int) -> None:
        """One picture."""
        self.add_picture(frame.stamp, frame.pixels)
