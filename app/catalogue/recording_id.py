"""A file of which a visitor stated something has an id of its own: what is computed of it is not the plain file's."""

from __future__ import annotations

from app.catalogue.part_id import whole_id
from app.catalogue.videos import split_id
from etnet.errors import RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions, TimeUnit

_MARK, _BETWEEN = "!", ","
_UNITS: tuple[TimeUnit, ...] = ("s", "ms", "us", "ns")
_SORT, _DROP = "sort", "drop"


def stated_id(recording_id: str, stated: Assumptions) -> str:
    """The id of the same file, opened with what is stated; of the file as it is where nothing is."""
    words = [
        "" if stated.width is None else f"{stated.width}x{stated.height}",
        stated.time_unit or "",
        "" if stated.polarity == "auto" else stated.polarity,
        _SORT if stated.sort else "",
        _DROP if stated.drop_outside else "",
    ]
    said = _BETWEEN.join(word for word in words if word)
    listed = listed_id(recording_id)
    return f"{listed}{_MARK}{said}" if said else listed


def stated_in(recording_id: str) -> Assumptions:
    """What an id states. An id comes from a page.

    Raises:
        RecordingError: it states what nothing takes.
    """
    _, mark, said = whole_id(recording_id).partition(_MARK)
    if not mark:
        return NOTHING_ASSUMED
    words = said.split(_BETWEEN)
    sides = next((word.split("x") for word in words if "x" in word), None)
    unit: TimeUnit | None = next((unit for unit in _UNITS if unit in words), None)
    polarity = "inverted" if "inverted" in words else "positive" if "positive" in words else "auto"
    if sides is not None and (len(sides) != 2 or not all(side.isascii() and side.isdigit() for side in sides)):
        raise RecordingError("the sensor that is stated is not understood; give it as 640×480")
    width, height = (None, None) if sides is None else (int(sides[0][:6]), int(sides[1][:6]))
    found = Assumptions(width, height, unit, polarity, _SORT in words, _DROP in words)
    if stated_id("", found) != f"{_MARK}{said}":
        raise RecordingError("what is stated of this recording is not understood; choose it again")
    return found


def listed_id(recording_id: str) -> str:
    """The id under which a file stands in the list, whatever is seen of it: a part, a film, with something stated."""
    return split_id(whole_id(recording_id).partition(_MARK)[0])[0]


def is_of(recording_id: str, forgotten: str) -> bool:
    """Whether one id is another, or one of a file with something stated."""
    return recording_id == forgotten or recording_id.startswith(f"{forgotten}{_MARK}")
