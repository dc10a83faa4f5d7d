"""Where files say how large their sensor is: attributes, datasets beside the events, calibrations."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from etnet.errors import RecordingError
from etnet.events.events import Sensor
from etnet.events.formats.base import Request
from etnet.events.formats.bounds import ANY_PIXELS, declared_sensor
from etnet.events.formats.column_finder import Tree

_WIDTHS = ("width", "sensor_width", "image_width", "w", "cols", "num_cols", "res_x")
_HEIGHTS = ("height", "sensor_height", "image_height", "h", "rows", "num_rows", "res_y")
_BOTH = ("resolution", "sensor_size", "sensor_resolution", "geometry", "image_size", "img_size", "size")
_CALIBRATIONS = ("", "calib/", "calibration/", "intrinsics/", "meta/", "info/")


def unless_stated(request: Request, read: Callable[[], Sensor | None]) -> Sensor | None:
    """What `read` finds declared. Nonsense is an error that says to state the size; where one is stated, it is none."""
    try:
        return read()
    except RecordingError:
        if request.assume.sensor is None:
            raise
        return None


def size_beside(tree: Tree, where: str, attributes: Callable[[str], Mapping[str, Any]], name: str) -> Sensor | None:
    """The size that stands nearest to the events in `where`, from there up to the top; None where none is stated.

    Two numbers under one name are width and height in either order: the larger one is the width.
    """
    for group in _upwards(where):
        for values in (attributes(group), *_scalars(tree, group)):
            sides = _sides(values)
            if sides is not None:
                return declared_sensor(*sides, name, ANY_PIXELS)
    return None


def sensor_resolution(value: Any, name: str) -> Sensor | None:
    """event_utils' attribute: (height, width)."""
    if value is None:
        return None
    sides = np.asarray(value).ravel()
    if sides.size < 2 or sides.dtype.kind not in "iuf" or not bool((sides[:2] >= 1).all()):
        raise RecordingError(
            f"{name}: its attribute sensor_resolution is {str(value)[:40]}; wanted (height, width): "
            "state the size with --assume width=…,height=…"
        )
    return declared_sensor(sides[1], sides[0], f"{name}: its attribute sensor_resolution", ANY_PIXELS)


def _upwards(where: str) -> Iterator[str]:
    parts = where.split("/") if where else []
    for count in range(len(parts), -1, -1):
        yield "/".join(parts[:count])


def _scalars(tree: Tree, group: str) -> Iterator[dict[str, Any]]:
    prefix = group + "/" if group else ""
    for folder in _CALIBRATIONS:
        found = {}
        for key in (*_WIDTHS, *_HEIGHTS, *_BOTH):
            leaf = tree.get(prefix + folder + key)
            if leaf is not None and leaf.is_numbers and int(np.prod(leaf.shape)) in (1, 2):
                found[key] = np.asarray(leaf.open()[()])
        yield found


def _sides(values: Mapping[str, Any]) -> tuple[Any, Any] | None:
    lower = {str(key).lower(): value for key, value in values.items()}
    width, height = (next((lower[key] for key in keys if key in lower), None) for keys in (_WIDTHS, _HEIGHTS))
    if width is not None and height is not None:
        return width, height
    for key in _BOTH:
        both = _two_numbers(lower.get(key))
        if both is not None:
            return max(both), min(both)
    return None


def _two_numbers(value: Any) -> tuple[int, int] | None:
    if isinstance(value, (str, bytes)):
        text = value.decode("ascii", "replace") if isinstance(value, bytes) else value
        found = re.fullmatch(r"\s*(\d{1,5})\s*[x×,; ]\s*(\d{1,5})\s*", text)
        return None if found is None else (int(found[1]), int(found[2]))
    if value is None:
        return None
    numbers = np.asarray(value).ravel()
    if numbers.size != 2 or numbers.dtype.kind not in "iuf" or not bool((numbers >= 1).all()):
        return None
    return int(numbers[0]), int(numbers[1])
