"""What a person knows about a file that the file does not say, and what may be mended in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.bounds import MAX_PIXELS

TimeUnit = Literal["s", "ms", "us", "ns"]

PixelRule = Literal["whole", "rounded", "32nds", "from1"]

Progress = Callable[[float], None]
"""Is told the fraction done, 0 … 1."""


@dataclass(frozen=True, slots=True)
class Assumptions:
    """Stated facts win over what is found in the file, and a remark says so.

    `width`, `height`: the sensor, both or neither. `time_unit`: what the stamps count. `polarity`: "auto" takes 0/1 and
    −1/+1, "inverted" swaps ON and OFF, "positive" takes every value above 0 as ON and the others as OFF.
    `sort` puts stamps in order, `drop_outside` leaves out events beyond the sensor; either makes the reader load the
    whole file. `max_pixels` bounds the sensor and the camera's pictures. `pixels`: "whole" takes coordinates as they
    are, "rounded" rounds fractions, "32nds" divides fixed-point numbers by 32, "from1" moves a count from 1 to 0.
    `topic` chooses among several cameras: in ROS the topic of the events, after a comma that of the pictures (either
    may be left out); in AEDAT 4 the number of the event stream.
    """

    width: int | None = None
    height: int | None = None
    time_unit: TimeUnit | None = None
    polarity: Literal["auto", "inverted", "positive"] = "auto"
    sort: bool = False
    drop_outside: bool = False
    max_pixels: int = MAX_PIXELS
    pixels: PixelRule = "whole"
    topic: str | None = None

    def __post_init__(self) -> None:
        if (self.width is None) != (self.height is None):
            raise RecordingError("an assumed sensor needs both sides; give width=… and height=…")
        for side in (self.width, self.height):
            if side is not None and not 0 < side <= 65_536:
                raise RecordingError(f"an assumed sensor side is {side}; it must be in 1 … 65,536 pixels")
        if self.pixels not in ("whole", "rounded", "32nds", "from1"):
            raise RecordingError(f'the pixel rule is "{self.pixels}"; it is one of whole, rounded, 32nds, from1')
        if self.max_pixels < 1:
            raise RecordingError(f"the bound on pixels is {self.max_pixels}; it is at least 1")
        if self.time_unit not in (None, "s", "ms", "us", "ns"):
            raise RecordingError(f'the assumed time unit is "{self.time_unit}"; it is one of s, ms, us, ns')
        if self.polarity not in ("auto", "inverted", "positive"):
            raise RecordingError(f'the polarity rule is "{self.polarity}"; it is one of auto, inverted, positive')

    @property
    def sensor(self) -> Sensor | None:
        """The stated sensor, if one is stated."""
        return None if self.width is None or self.height is None else Sensor(self.width, self.height)

    @property
    def mends(self) -> bool:
        """Whether the whole file has to be looked through at opening."""
        return self.sort or self.drop_outside


def said_unit(unit: TimeUnit) -> str:
    """What a reader remarks when it follows the stated unit; without it `open` says that the unit was not used."""
    return f"time unit {unit}, as stated"


NOTHING_ASSUMED = Assumptions()
"""The file is taken at its word."""
