"""The part of a view that looks after the recording itself: the doctor's page, and what is cut out of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from etnet.windows import Policy, Window


@dataclass(frozen=True, slots=True)
class Examine:
    """Open the doctor's page of the recording on show, or close it."""

    is_open: bool


@dataclass(frozen=True, slots=True)
class MarkTrim:
    """The window on show is the first one of what is cut out, or the last."""

    end: Literal["from", "to"]


@dataclass(frozen=True, slots=True)
class Trim:
    """Make what lies between the marks into a recording of its own, in the background."""


@dataclass(frozen=True, slots=True)
class DropTrim:
    """What is being cut out is not wanted any more, or it has been handed over."""


RecordingIntent = Examine | MarkTrim | Trim | DropTrim


@dataclass(frozen=True, slots=True)
class Mark:
    """One end of a cut: an event's index, and the stamp (µs) that the window begins or ends with."""

    event: int
    stamp: int


@dataclass(frozen=True, slots=True)
class Excerpt:
    """What is marked of a recording; `None` is its beginning, or its end."""

    recording_id: str = ""
    begin: Mark | None = None
    end: Mark | None = None

    @property
    def is_marked(self) -> bool:
        """Whether there is anything to cut."""
        return self.begin is not None or self.end is not None


@dataclass(frozen=True, slots=True)
class TrimOrder:
    """What is being cut out, complete in itself; model, precision and windows say whose playback reads the events."""

    excerpt: Excerpt
    model_id: str
    precision: Literal["auto", "fp32", "bf16"]
    policy: Policy


@dataclass(frozen=True, slots=True)
class RecordingState:
    """`examines`: the doctor's page is open. A browser keeps none of this: a page that comes back costs nothing."""

    examines: bool = False
    excerpt: Excerpt = Excerpt()
    cut: TrimOrder | None = None


def reduce_recording(
    view: RecordingState,
    intent: RecordingIntent,
    recording_id: str,
    window: Window | None,
    order: Callable[[Excerpt], TrimOrder | None],
) -> RecordingState:
    """The part after `intent`, which came while `window` of a recording was on show; `order` completes a cut.

    Marks in the wrong order are no cut: the one that was set last stays.
    """
    match intent:
        case Examine(is_open):
            return replace(view, examines=bool(is_open))
        case MarkTrim(end):
            if window is None:
                return view
            return replace(view, excerpt=_marked(view.excerpt, end, recording_id, window), cut=None)
        case Trim():
            excerpt = view.excerpt
            is_here = excerpt.is_marked and excerpt.recording_id == recording_id
            return replace(view, cut=order(excerpt)) if is_here else view
        case DropTrim():
            return replace(view, cut=None)


def _marked(excerpt: Excerpt, end: str, recording_id: str, window: Window) -> Excerpt:
    if excerpt.recording_id != recording_id:
        excerpt = Excerpt(recording_id)
    if end == "from":
        begin = Mark(window.start, window.t_start)
        keeps = excerpt.end is not None and excerpt.end.event > begin.event
        return replace(excerpt, begin=begin, end=excerpt.end if keeps else None)
    stop = Mark(window.stop, window.t_stop)
    keeps = excerpt.begin is not None and excerpt.begin.event < stop.event
    return replace(excerpt, end=stop, begin=excerpt.begin if keeps else None)


_WORDS: dict[str, RecordingIntent] = {
    "examine:on": Examine(True),
    "examine:off": Examine(False),
    "from": MarkTrim("from"),
    "to": MarkTrim("to"),
    "cut": Trim(),
    "leave": DropTrim(),
}


def heard(text: str) -> RecordingIntent | None:
    """What a click on one of our own buttons says; `None` for what none of them sends."""
    return _WORDS.get(text)
