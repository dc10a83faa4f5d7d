"""Under which names files keep x, y, t and p: one list for tables of every container."""

from __future__ import annotations

import re
from collections.abc import Iterable

from etnet.events.assumptions import TimeUnit

NAMES = {
    "x": (
        *("x", "xs", "xpos", "posx", "xaddr", "addrx", "xaddress", "addressx", "xcoord", "coordx"),
        *("xcoordinate", "coordinatex", "xcoords", "xcoordinates", "xloc", "locx", "xlocation"),
        *("locationx", "xposition", "positionx", "pixelx", "xpixel", "xpixels", "pixelsx", "xpix"),
        *("pixx", "col", "cols", "column", "columns", "u"),
    ),
    "y": (
        *("y", "ys", "ypos", "posy", "yaddr", "addry", "yaddress", "addressy", "ycoord", "coordy"),
        *("ycoordinate", "coordinatey", "ycoords", "ycoordinates", "yloc", "locy", "ylocation"),
        *("locationy", "yposition", "positiony", "pixely", "ypixel", "ypixels", "pixelsy", "ypix"),
        *("pixy", "row", "rows", "v"),
    ),
    "t": ("t", "ts", "timestamp", "timestamps", "time", "times", "stamp", "stamps", "tstamp", "tstamps"),
    "p": ("p", "ps", "pol", "pols", "polarity", "polarities", "on", "ison", "onoff", "sign", "signs"),
}
"""By axis, the names that are taken before the others first; in lower case, with nothing but letters."""

PAIR = ("xy", "xys", "coords", "coordinates", "pixels", "positions", "locations", "addresses")
"""One n × 2 array that holds both pixels."""

_UNITS: tuple[tuple[TimeUnit, tuple[str, ...]], ...] = (
    ("us", ("us", "µs", "μs", "usec", "usecs", "micros", "microsec", "microseconds", "microsecond")),
    ("ns", ("ns", "nsec", "nanos", "nanosec", "nanoseconds", "nanosecond")),
    ("ms", ("ms", "msec", "millis", "millisec", "milliseconds", "millisecond")),
    ("s", ("s", "sec", "secs", "seconds", "second")),
)
_LETTERS = re.compile(r"[^a-zµμ]+")
_BELONGINGS = re.compile(r"^(dataset|events?|evs?|evt|dvs|cd|td)(?=.)")


def named_axis(name: str) -> tuple[str, TimeUnit | None] | None:
    """Which of x, y, t, p, or "xy", a column of this name holds, and the unit that its name states; None if neither."""
    whole = name.strip().strip("\"'").lower()
    plain, _, bracketed = whole.replace("[", "(").partition("(")
    words = [word for word in _LETTERS.split(plain) if word]
    unit = _unit(_LETTERS.sub("", bracketed))
    if unit is None and len(words) > 1:
        unit = _unit(words[-1])
        words = words if unit is None else words[:-1]
    stem = "".join(words)
    axis = _axis(stem)
    if axis is None and unit is None:
        axis, unit = _glued(stem)
    return None if axis is None else (axis, unit if axis == "t" else None)


def stated_unit(text: object) -> TimeUnit | None:
    """The unit that the value of `time_unit` names, which our own files have beside their columns; None if none."""
    word = text.decode("utf-8", "replace") if isinstance(text, bytes) else text
    return _unit(word.strip().lower()) if isinstance(word, str) else None


def column_keys(keys: Iterable[str]) -> dict[str, str] | None:
    """Which of `keys` holds which of x, y, t and p; x and y may be one, under "xy". None if one is missing."""
    found: dict[str, list[str]] = {}
    for key in keys:
        named = named_axis(key)
        if named is not None:
            found.setdefault(named[0], []).append(key)
    whole = {axis: min(names, key=lambda name, axis=axis: _rank(axis, name)) for axis, names in found.items()}
    if all(axis in whole for axis in "xytp"):
        return {axis: whole[axis] for axis in "xytp"}
    if all(axis in whole for axis in ("xy", "t", "p")):
        return {axis: whole[axis] for axis in ("xy", "t", "p")}
    return None


def _rank(axis: str, name: str) -> tuple[int, int]:
    """The names that stand first in the list, and of those the plainest, are taken."""
    plain = _LETTERS.sub("", name.lower())
    names = PAIR if axis == "xy" else NAMES[axis]
    return (names.index(plain) if plain in names else len(names), len(name))


def _axis(stem: str) -> str | None:
    for bare in (stem, _BELONGINGS.sub("", stem), _BELONGINGS.sub("", _BELONGINGS.sub("", stem))):
        for axis, names in NAMES.items():
            if bare in names:
                return axis
        if bare in PAIR:
            return "xy"
    return None


def _glued(stem: str) -> tuple[str | None, TimeUnit | None]:
    """A unit that is written onto the name, such as "tus" or "timestampns"."""
    for unit, endings in _UNITS:
        for ending in endings:
            if len(ending) > 1 and stem.endswith(ending) and _axis(stem.removesuffix(ending)) == "t":
                return "t", unit
    return None, None


def _unit(word: str) -> TimeUnit | None:
    return next((unit for unit, names in _UNITS if word in names), None)
