"""A file of which a visitor stated something, or which is seen in another way, has an id of its own.

What is computed of it is not the plain file's. The id says all of it: "file-12ab!640x480,us,bin2,turn90".
"""

from __future__ import annotations

from app.catalogue.videos import split_id
from etnet.errors import RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions, TimeUnit
from etnet.events.opened_as import OpenedAs, View
from etnet.events.recording import Recording

_PART = "^"


def known_as(recording_id: str, recording: Recording) -> str:
    """The id of what was opened by an id: the same, or that of a part, which the number of its events tells."""
    whole = whole_id(recording_id)
    return whole if recording.growth is None else f"{whole}{_PART}{recording.num_events}"


def whole_id(recording_id: str) -> str:
    """The id of the file of which this may be a part."""
    return recording_id.partition(_PART)[0]


_MARK, _BETWEEN = "!", ","
_MARKS = ("!", "~", "^", " ")
"""What may follow on a file's id: something stated, a film's setting, how much is indexed, and what came last of it."""
_UNITS: tuple[TimeUnit, ...] = ("s", "ms", "us", "ns")
_SORT, _DROP = "sort", "drop"


_FLIPS = ("horizontal", "vertical", "both")


def stated_id(recording_id: str, stated: Assumptions) -> str:
    """The id of the same file, opened with what is stated; of the file as it is where nothing is."""
    return _id(recording_id, _stated_words(stated), _seen_words(view_in(recording_id)))


def seen_id(recording_id: str, view: View | None) -> str:
    """The id of the same file, seen in this way; `None` leaves that to the viewer."""
    return _id(recording_id, _stated_words(stated_in(recording_id)), _seen_words(view))


def opened_id(recording_id: str, opened: OpenedAs) -> str:
    """The id of the same file, opened as it was before."""
    return _id(recording_id, _stated_words(opened.assumed), _seen_words(opened.view))


def _id(recording_id: str, *words: list[str]) -> str:
    said = _BETWEEN.join(word for part in words for word in part if word)
    listed = listed_id(recording_id)
    return f"{listed}{_MARK}{said}" if said else listed


def _seen_words(view: View | None) -> list[str]:
    if view is None:
        return []
    region = "" if view.region is None else "at" + "-".join(map(str, view.region))
    flip = "" if view.flip == "none" else f"flip-{view.flip}"
    return [f"bin{view.downsample}", region, flip, f"turn{view.rotate}" if view.rotate else ""]


def view_in(recording_id: str) -> View | None:
    """How a file is seen, as an id says it; `None` where it leaves that to the viewer. An id comes from a page.

    Raises:
        RecordingError: it says what nothing takes.
    """
    words = _words_of(recording_id)
    factor = next((word[3:] for word in words if word.startswith("bin")), None)
    if factor is None:
        return None
    region = next((word[2:].split("-") for word in words if word.startswith("at")), None)
    flip = next((word[5:] for word in words if word.startswith("flip-")), "none")
    turn = next((word[4:] for word in words if word.startswith("turn")), "0")
    numbers = [factor, turn, *(region or [])]
    if not all(number.isascii() and number.isdigit() and len(number) <= 6 for number in numbers):
        raise RecordingError("how this recording is seen is not understood; choose it again")
    part = None if region is None else tuple(map(int, region))
    if (part is not None and len(part) != 4) or (flip != "none" and flip not in _FLIPS):
        raise RecordingError("how this recording is seen is not understood; choose it again")
    return View(part, int(factor), flip, int(turn))  # pyright: ignore[reportArgumentType]  View checks them


def _words_of(recording_id: str) -> list[str]:
    _, _, said = whole_id(recording_id).partition(_MARK)
    return said.split(_BETWEEN) if said else []


def _stated_words(stated: Assumptions) -> list[str]:
    return [
        "" if stated.width is None else f"{stated.width}x{stated.height}",
        stated.time_unit or "",
        "" if stated.polarity == "auto" else stated.polarity,
        _SORT if stated.sort else "",
        _DROP if stated.drop_outside else "",
    ]


def stated_in(recording_id: str) -> Assumptions:
    """What an id states. An id comes from a page.

    Raises:
        RecordingError: it states what nothing takes.
    """
    words = _words_of(recording_id)
    if not words:
        return NOTHING_ASSUMED
    sides = next((word.split("x") for word in words if "x" in word), None)
    unit: TimeUnit | None = next((unit for unit in _UNITS if unit in words), None)
    polarity = "inverted" if "inverted" in words else "positive" if "positive" in words else "auto"
    if sides is not None and (len(sides) != 2 or not all(side.isascii() and side.isdigit() for side in sides)):
        raise RecordingError("the sensor that is stated is not understood; give it as 640×480")
    width, height = (None, None) if sides is None else (int(sides[0][:6]), int(sides[1][:6]))
    found = Assumptions(width, height, unit, polarity, _SORT in words, _DROP in words)
    if _BETWEEN.join([word for word in (*_stated_words(found), *_seen_words(view_in(recording_id))) if word]) != (
        _BETWEEN.join(words)
    ):
        raise RecordingError("what is stated of this recording is not understood; choose it again")
    return found


def listed_id(recording_id: str) -> str:
    """The id under which a file stands in the list, whatever is seen of it: a part, a film, with something stated."""
    return split_id(whole_id(recording_id).partition(_MARK)[0])[0]


def is_of(recording_id: str, forgotten: str) -> bool:
    """Whether one id is another, or one of the same file: a part of it, its film, or with something stated."""
    if not forgotten or not recording_id.startswith(forgotten):
        return False
    return recording_id == forgotten or recording_id[len(forgotten)] in _MARKS
