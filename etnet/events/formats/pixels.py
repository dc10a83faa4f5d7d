"""Coordinates as files hold them, turned into pixels of 16 bits; and which of them lie nowhere on a sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Shaped, UInt16

from etnet.errors import RecordingError
from etnet.events.assumptions import PixelRule
from etnet.events.events import Sensor
from etnet.events.formats.base import Remarks

KNOWN_SENSORS = (
    (34, 34, "N-MNIST's crop"),
    (128, 128, "DVS128"),
    (240, 180, "DAVIS240"),
    (304, 240, "ATIS"),
    (320, 240, "DVXplorer Lite"),
    (320, 320, "GenX320"),
    (346, 260, "DAVIS346"),
    (480, 360, "Gen3 VGA crop"),
    (640, 480, "Gen3 or DVXplorer"),
    (1280, 720, "Gen4 or IMX636"),
)
LARGEST_DEDUCED_SIDE = 4096
"""Events that reach farther than any sensor built so far mean that the file is read wrongly."""

FIXED_POINT = 32
"""Parts of a pixel that BS-ERGB's coordinates count."""

FEW = 0.01
"""The share of events beyond the sensor up to which they count as strays; if there are more, the size is wrong."""

_FEWEST_FIXED = 64
"""Events from which on it is no chance that all coordinates are multiples of 32."""


class Placed(NamedTuple):
    """Pixels, and which events lie nowhere on any sensor (None: all of them lie somewhere)."""

    x: UInt16[np.ndarray, " n"]
    y: UInt16[np.ndarray, " n"]
    nowhere: Bool[np.ndarray, " n"] | None


def placed(x: Shaped[np.ndarray, " n"], y: Shaped[np.ndarray, " n"], rule: PixelRule, name: str) -> Placed:
    """Both columns by the stated rule. What is negative or beyond 65,535 lies nowhere; fractions are an error."""
    columns, nowhere = [], None
    for values, axis in ((x, "x"), (y, "y")):
        column, is_off = _column(values, axis, rule, name)
        columns.append(column)
        if is_off is not None:
            nowhere = is_off if nowhere is None else nowhere | is_off
    return Placed(columns[0], columns[1], nowhere)


def pixel_column(values: Shaped[np.ndarray, " n"], axis: str, name: str, rule: PixelRule = "whole") -> np.ndarray:
    """One column as u16; what lies nowhere is an error that names the event."""
    column, is_off = _column(values, axis, rule, name)
    if is_off is not None:
        first = int(np.argmax(is_off))
        raise RecordingError(
            f"{name}: event {first} of this part has {axis} = {values[first]}, which is no pixel; "
            "leave such events out with --drop-outside"
        )
    return column


def _column(
    values: Shaped[np.ndarray, " n"], axis: str, rule: PixelRule, name: str
) -> tuple[np.ndarray, Bool[np.ndarray, " n"] | None]:
    if values.dtype == np.uint16 and rule == "whole":
        return values, None
    if values.dtype.kind not in "iuf":
        raise RecordingError(f"{name}: its {axis} column is of type {values.dtype}; whole numbers are wanted")
    if len(values) == 0:
        return np.empty(0, np.uint16), None
    if rule != "whole":
        values = in_pixels(values, rule)
    if values.dtype.kind == "f":
        _check_whole(values, axis, name)
    low, high = values.min(), values.max()
    if low >= 0 and high < 65_536:
        return values.view(np.uint16) if values.dtype == np.int16 else values.astype(np.uint16), None
    is_off = (values < 0) | (values >= 65_536)
    return np.where(is_off, 0, values).astype(np.uint16), is_off


def in_pixels(values: Shaped[np.ndarray, " n"], rule: PixelRule) -> Shaped[np.ndarray, " n"]:
    """Stored coordinates by the stated rule: as numbers, whatever lies on a sensor or not."""
    if rule == "rounded":
        return np.rint(values)
    if rule == "from1":
        return values - 1 if values.dtype.kind == "f" else values.astype(np.int64) - 1
    # Slightly below 0 they were stored without their sign: no sensor has 2,016 pixels and more in 16 bits of 32nds.
    signed = values.view(np.int16) if values.dtype == np.uint16 else values
    return np.rint(signed / FIXED_POINT).astype(np.int64)


def _check_whole(values: Shaped[np.ndarray, " n"], axis: str, name: str) -> None:
    is_whole = values == np.floor(values)
    if not is_whole.all():
        first = int(np.argmin(is_whole))
        if not np.isfinite(values[first]):
            raise RecordingError(f"{name}: event {first} of this part has {axis} = {values[first]}; mend it")
        raise RecordingError(
            f"{name}: event {first} of this part has {axis} = {values[first]:g}, a fraction of a pixel (rectified?); "
            "open it with --pixels rounded"
        )


def is_far(x: UInt16[np.ndarray, " n"], y: UInt16[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Which events lie farther out than on any sensor."""
    return (x >= LARGEST_DEDUCED_SIDE) | (y >= LARGEST_DEDUCED_SIDE)


@dataclass
class Reach:
    """How far the events go that lie somewhere, and whether all of their coordinates are multiples of 32."""

    low_x: int = 65_536
    low_y: int = 65_536
    high_x: int = -1
    high_y: int = -1
    num_events: int = 0
    num_odd: int = 0
    near_x: int = -1
    near_y: int = -1
    num_far: int = 0
    """Events farther out than on any sensor; `near_x` and `near_y` are how far the others go."""

    def look(self, x: UInt16[np.ndarray, " n"], y: UInt16[np.ndarray, " n"]) -> None:
        """Take in a piece."""
        if len(x) == 0:
            return
        self.low_x, self.high_x = min(self.low_x, int(x.min())), max(self.high_x, int(x.max()))
        self.low_y, self.high_y = min(self.low_y, int(y.min())), max(self.high_y, int(y.max()))
        if max(self.high_x, self.high_y) < LARGEST_DEDUCED_SIDE:
            self.near_x, self.near_y = self.high_x, self.high_y
        else:
            self._look_near(x, y)
        if self.num_odd <= 0.01 * self.num_events:  # enough were seen as soon as they are not few
            self.num_odd += int(np.count_nonzero((x | y) & (FIXED_POINT - 1)))
        self.num_events += len(x)

    def _look_near(self, x: UInt16[np.ndarray, " n"], y: UInt16[np.ndarray, " n"]) -> None:
        is_near = ~is_far(x, y)
        self.num_far += len(x) - int(np.count_nonzero(is_near))
        if is_near.any():
            self.near_x, self.near_y = max(self.near_x, int(x[is_near].max())), max(self.near_y, int(y[is_near].max()))

    @property
    def has_few_far(self) -> bool:
        """Whether some events, but no more than strays are, lie farther out than on any sensor."""
        return 0 < self.num_far <= FEW * self.num_events

    @property
    def on_sensor(self) -> tuple[int, int]:
        """How far the events go, without a few that can be on no sensor."""
        return (self.near_x, self.near_y) if self.has_few_far else (self.high_x, self.high_y)

    @property
    def is_fixed_point(self) -> bool:
        """Whether they are 32nds of pixels; some slightly below 0 may have lost their sign."""
        is_far = max(self.high_x, self.high_y) >= 1024
        return is_far and self.num_events >= _FEWEST_FIXED and self.num_odd <= 0.01 * self.num_events

    def fixed_point_fault(self) -> str:
        """What is wrong and what to do, for an error that begins with the file's name."""
        return (
            f"its x and y are multiples of {FIXED_POINT} up to ({self.high_x}, {self.high_y}): fixed-point pixels, as "
            f"in BS-ERGB, and no larger sensor; open it with --pixels 32nds, which divides them by {FIXED_POINT}"
        )


def deduced_sensor(reach_x: int, reach_y: int, name: str, remarks: Remarks, where: str = "the events") -> Sensor:
    """The sensor of a file that names none: a known size that the events nearly fill, else just what they reach."""
    if max(reach_x, reach_y) >= LARGEST_DEDUCED_SIDE:
        raise RecordingError(
            f"{name}: it names no sensor and its events reach pixel ({reach_x}, {reach_y}), which no sensor has; "
            "state the size with --assume width=…,height=… or check that the format is right"
        )
    model = _known(reach_x, reach_y)
    sensor, called = Sensor(reach_x + 1, reach_y + 1), ""
    if model is not None:
        sensor, called = Sensor(model[0], model[1]), f" ({model[2]})"
    remarks.assumed(
        f"sensor {sensor}{called}: the file names none and {where} reach pixel ({reach_x}, {reach_y}); "
        "--assume width=…,height=… overrules"
    )
    return sensor


def is_size_of_events(reach: Reach, size: Sensor) -> bool:
    """Whether the camera's pictures are as large as the sensor: all events lie in them, and fill no other sensor."""
    if reach.high_x >= size.width or reach.high_y >= size.height:
        return False
    model = _known(reach.high_x, reach.high_y)
    return model is None or model[:2] == (size.width, size.height)


def advise_on_pixels(reach: Reach, sensor: Sensor, remarks: Remarks) -> None:
    """What is odd about the pixels of a file that names no sensor: they count from 1, or x and y are swapped."""
    if reach.num_events < _FEWEST_FIXED:
        return
    high = reach.high_x, reach.high_y
    counts_from_one = (reach.low_x, reach.low_y) == (1, 1) and (
        any(high == (width, height) for width, height, _ in KNOWN_SENSORS)
        or (_known(*high) is None and reach.num_events >= 20 * (sensor.width + sensor.height))
    )
    if counts_from_one:
        remarks.advise(
            f"no event lies in row or column 0 and they reach ({high[0]}, {high[1]}): pixels seem to count from 1; "
            "open it with --pixels from1"
        )
    elif _known(*high) is None and high[1] > high[0] and _known(high[1], high[0]) is not None:
        width, height, model = _known(high[1], high[0]) or (0, 0, "")
        remarks.advise(
            f"the events fill {sensor}, a {model} ({width}×{height}) on its side: x and y may be swapped; "
            "--flip vertical --rotate 90 swaps them"
        )


def odd_pixels(reach: Reach, sensor: Sensor) -> str:
    """Why events lie beyond a sensor of known size, and what to do; "" where nothing tells."""
    width, height = sensor.width, sensor.height
    if reach.num_events < _FEWEST_FIXED:
        return ""
    if (reach.low_x, reach.low_y) == (1, 1) and reach.high_x <= width and reach.high_y <= height:
        return (
            f"no event lies in row or column 0 and they reach ({reach.high_x}, {reach.high_y}): pixels seem to count "
            "from 1; open it with --pixels from1"
        )
    if reach.high_x < height and width > reach.high_y >= height:
        return (
            f"x and y may be swapped, for the events fit {height}×{width}: --assume width={height},height={width} "
            "--flip vertical --rotate 90 swaps them"
        )
    return ""


def _known(reach_x: int, reach_y: int) -> tuple[int, int, str] | None:
    for width, height, model in KNOWN_SENSORS:
        if 0.9 * width <= reach_x + 1 <= width and 0.9 * height <= reach_y + 1 <= height:
            return width, height, model
    return None
