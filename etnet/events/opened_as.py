"""How a file was opened: what was stated of it, and which part of it is looked at, and how."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from etnet.errors import RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions
from etnet.events.cleaning import UNCLEANED, Cleaning


@dataclass(frozen=True, slots=True)
class View:
    """`region` is (x, y, width, height) in the sensor's pixels; `rotate` turns clockwise by so many degrees."""

    region: tuple[int, int, int, int] | None = None
    downsample: Literal[1, 2, 4] = 1
    flip: Literal["none", "horizontal", "vertical", "both"] = "none"
    rotate: Literal[0, 90, 180, 270] = 0

    def __post_init__(self) -> None:
        if self.downsample not in (1, 2, 4):
            raise RecordingError(f"a view is downsampled by {self.downsample}; it takes 1, 2 or 4")
        if self.flip not in ("none", "horizontal", "vertical", "both"):
            raise RecordingError(f'a view is flipped "{self.flip}"; it takes none, horizontal, vertical or both')
        if self.rotate not in (0, 90, 180, 270):
            raise RecordingError(f"a view is rotated by {self.rotate}°; it takes 0, 90, 180 or 270")
        if self.region is not None and (min(self.region) < 0 or min(self.region[2:]) < 1):
            raise RecordingError(f"a view's region is {self.region}; it takes x, y ≥ 0 and width, height ≥ 1")

    @property
    def changes_pixels(self) -> bool:
        """Whether events move, apart from the region."""
        return self.downsample != 1 or self.flip != "none" or self.rotate != 0


WHOLE_VIEW = View()
"""All of it, as it is."""


@dataclass(frozen=True, slots=True)
class OpenedAs:
    """The same file opened as the same gives the same events."""

    assumed: Assumptions = NOTHING_ASSUMED
    view: View = WHOLE_VIEW
    cleaning: Cleaning = UNCLEANED
    """What was taken out of it then."""
