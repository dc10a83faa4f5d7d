"""What somebody can state about a file on a command line. Errors and remarks name these options."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from etnet.errors import RecordingError
from etnet.events.assumptions import Assumptions
from etnet.events.formats.bounds import MAX_PIXELS, allow_unpacking

MOST_UNPACKED = 1 << 24
"""MB that `--unpack-limit` takes."""


@dataclass(frozen=True)
class Stated:
    """What a file does not say itself, and what may be mended in it."""

    assume: str | None = None
    """The sensor: width=640,height=480."""
    sort: bool = False
    """Sort timestamps; the whole file is loaded."""
    drop_outside: bool = False
    """Leave out events beyond the sensor; the whole file is loaded."""
    polarity: Literal["auto", "inverted", "positive"] = "auto"
    """"auto" takes 0/1 and −1/+1, "inverted" swaps ON and OFF, "positive" takes every value above 0 as ON."""
    time_unit: Literal["s", "ms", "us", "ns"] | None = None
    """Unit of the timestamps."""
    max_pixels: int = MAX_PIXELS
    """Most pixels of a sensor or camera picture that a file may declare."""
    pixels: Literal["whole", "rounded", "32nds", "from1"] = "whole"
    """"rounded" rounds fractions, "32nds" divides fixed-point coordinates, "from1" takes a count from 1 to 0."""
    topic: str | None = None
    """Of several cameras: the ROS topic of the events, and after a comma that of the pictures; the AEDAT4 stream."""
    unpack_limit: int | None = None
    """MB that a file you trust may unpack to, also where its size speaks against it: above 256 MB, and 200 times its
    size, it is refused."""

    def __post_init__(self) -> None:
        if self.unpack_limit is not None and not 1 <= self.unpack_limit <= MOST_UNPACKED:
            raise RecordingError(f"--unpack-limit {self.unpack_limit}: wanted 1 … {MOST_UNPACKED:,} MB")

    @staticmethod
    def of(assumed: Assumptions) -> Stated:
        """What has to be stated for a reader to assume this."""
        size = None if assumed.sensor is None else f"width={assumed.width},height={assumed.height}"
        return Stated(
            size,
            assumed.sort,
            assumed.drop_outside,
            assumed.polarity,
            assumed.time_unit,
            assumed.max_pixels,
            assumed.pixels,
            assumed.topic,
        )

    def assumptions(self) -> Assumptions:
        """The same, for a reader. A limit that was lifted is lifted for this process from now on."""
        if self.unpack_limit is not None:
            allow_unpacking(self.unpack_limit << 20)
        width, height = _sensor(self.assume)
        return Assumptions(
            width,
            height,
            self.time_unit,
            self.polarity,
            self.sort,
            self.drop_outside,
            self.max_pixels,
            self.pixels,
            self.topic,
        )


def _sensor(text: str | None) -> tuple[int | None, int | None]:
    if text is None:
        return None, None
    found = re.fullmatch(r"width=(\d+),height=(\d+)", text.replace(" ", ""))
    if found is None:
        raise RecordingError(f"--assume {text!r} is not understood; it takes width=640,height=480")
    return int(found[1]), int(found[2])
