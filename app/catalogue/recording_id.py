"""The grammar of ids: which file, of a video which film, what is stated of it, how it is seen, how much is indexed.

"file-12ab!640x480,us,bin2,turn90^4000": what is computed of a file of which something is stated, which is seen in
another way, or of which a part is there, is not the plain file's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from app.catalogue.videos import split_id
from etnet.errors import RecordingError
from etnet.events.assumptions import NOTHING_ASSUMED, Assumptions, TimeUnit
from etnet.events.opened_as import OpenedAs, View
from etnet.events.recording import Recording

_FILM, _SAID, _BETWEEN, _PART = "~", "!", ",", "^"
_MARKS = (_FILM, _SAID, _PART, " ")
"""What may follow on a file's id: a film's setting, something stated, how much is indexed, and what came last of it."""
_UNITS: tuple[TimeUnit, ...] = ("s", "ms", "us", "ns")
_SORT, _DROP = "sort", "drop"
_FLIPS = ("horizontal", "vertical", "both")


@dataclass(frozen=True, slots=True)
class RecordingId:
    """What an id says. It comes from a page: what it states is understood, or refused, when it is asked for."""

    base: str
    """Under which the file stands in the list."""
    film: str = ""
    """The setting under which a video's film is made."""
    said: tuple[str, ...] = ()
    """What is stated of the file, and how it is seen, word by word."""
    part: str = ""
    """The number of events of the part that is there."""

    @classmethod
    def of(cls, recording_id: str) -> RecordingId:
        """An id, taken apart."""
        whole, _, part = recording_id.partition(_PART)
        file, _, said = whole.partition(_SAID)
        base = split_id(file)[0]
        return cls(base, file[len(base) + 1 :], tuple(said.split(_BETWEEN)) if said else (), part)

    def __str__(self) -> str:
        parts = (("", self.base), (_FILM, self.film), (_SAID, _BETWEEN.join(self.said)), (_PART, self.part))
        return "".join(f"{mark}{words}" for mark, words in parts if words)

    @property
    def seen(self) -> View | None:
        """How the file is seen; `None` where that is left to the viewer.

        Raises:
            RecordingError: it says what nothing takes.
        """
        factor = next((word[3:] for word in self.said if word.startswith("bin")), None)
        if factor is None:
            return None
        region = next((word[2:].split("-") for word in self.said if word.startswith("at")), None)
        flip = next((word[5:] for word in self.said if word.startswith("flip-")), "none")
        turn = next((word[4:] for word in self.said if word.startswith("turn")), "0")
        numbers = [factor, turn, *(region or [])]
        if not all(number.isascii() and number.isdigit() and len(number) <= 6 for number in numbers):
            raise RecordingError("how this recording is seen is not understood; choose it again")
        part = None if region is None else tuple(map(int, region))
        if (part is not None and len(part) != 4) or (flip != "none" and flip not in _FLIPS):
            raise RecordingError("how this recording is seen is not understood; choose it again")
        return View(part, int(factor), flip, int(turn))  # pyright: ignore[reportArgumentType]  View checks them

    @property
    def stated(self) -> Assumptions:
        """What is stated of the file.

        Raises:
            RecordingError: it states what nothing takes.
        """
        words = self.said
        if not words:
            return NOTHING_ASSUMED
        sides = next((word.split("x") for word in words if "x" in word), None)
        unit: TimeUnit | None = next((unit for unit in _UNITS if unit in words), None)
        polarity = "inverted" if "inverted" in words else "positive" if "positive" in words else "auto"
        if sides is not None and (len(sides) != 2 or not all(side.isascii() and side.isdigit() for side in sides)):
            raise RecordingError("the sensor that is stated is not understood; give it as 640×480")
        width, height = (None, None) if sides is None else (int(sides[0][:6]), int(sides[1][:6]))
        found = Assumptions(width, height, unit, polarity, _SORT in words, _DROP in words)
        if (*_stated_words(found), *_seen_words(self.seen)) != words:
            raise RecordingError("what is stated of this recording is not understood; choose it again")
        return found


def stated_id(recording_id: str, stated: Assumptions) -> str:
    """The id of the same file, opened with what is stated; of the file as it is where nothing is."""
    known = RecordingId.of(recording_id)
    return str(RecordingId(known.base, said=(*_stated_words(stated), *_seen_words(known.seen))))


def seen_id(recording_id: str, view: View | None) -> str:
    """The id of the same file, seen in this way; `None` leaves that to the viewer."""
    known = RecordingId.of(recording_id)
    return str(RecordingId(known.base, said=(*_stated_words(known.stated), *_seen_words(view))))


def opened_id(recording_id: str, opened: OpenedAs) -> str:
    """The id of the same file, opened as it was before."""
    said = (*_stated_words(opened.assumed), *_seen_words(opened.view))
    return str(RecordingId(listed_id(recording_id), said=said))


def known_as(recording_id: str, recording: Recording) -> str:
    """The id of what was opened by an id: the same, or that of a part, which the number of its events tells."""
    whole = whole_id(recording_id)
    return whole if recording.growth is None else f"{whole}{_PART}{recording.num_events}"


def whole_id(recording_id: str) -> str:
    """The id of the file of which this may be a part."""
    return recording_id.partition(_PART)[0]


@lru_cache(maxsize=256)
def listed_id(recording_id: str) -> str:
    """The id under which a file stands in the list, whatever is seen of it: a part, a film, with something stated."""
    return RecordingId.of(recording_id).base


def is_of(recording_id: str, forgotten: str) -> bool:
    """Whether one id is another, or one of the same file: a part of it, its film, or with something stated."""
    if not forgotten or not recording_id.startswith(forgotten):
        return False
    return recording_id == forgotten or recording_id[len(forgotten)] in _MARKS


def _seen_words(view: View | None) -> tuple[str, ...]:
    if view is None:
        return ()
    region = "" if view.region is None else "at" + "-".join(map(str, view.region))
    flip = "" if view.flip == "none" else f"flip-{view.flip}"
    words = (f"bin{view.downsample}", region, flip, f"turn{view.rotate}" if view.rotate else "")
    return tuple(word for word in words if word)


def _stated_words(stated: Assumptions) -> tuple[str, ...]:
    words = (
        "" if stated.width is None else f"{stated.width}x{stated.height}",
        stated.time_unit or "",
        "" if stated.polarity == "auto" else stated.polarity,
        _SORT if stated.sort else "",
        _DROP if stated.drop_outside else "",
    )
    return tuple(word for word in words if word)
