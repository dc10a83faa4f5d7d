"""What looks after the recording itself: its statistics, and what is trimmed out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from app.engine.downloads import Downloaded
from app.engine.requests import Precision
from app.state import intents as ask
from app.state.checks import passing
from app.state.view_state import ViewState
from app.views.view import Here
from etnet.windows import Policy, Window

TRIM_SLOT = "recording.trim"


@dataclass(frozen=True, slots=True)
class MarkTrim:
    """The current window is the first one of what is trimmed out, or the last."""

    end: Literal["from", "to"]


@dataclass(frozen=True, slots=True)
class Trim:
    """Make what lies between the marks into a recording of its own, in the background."""


@dataclass(frozen=True, slots=True)
class DropTrim:
    """What is being trimmed out is not wanted any more."""


@dataclass(frozen=True, slots=True)
class Mark:
    """One end of a stretch: an event's index, and the stamp (µs) that the window begins or ends with."""

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
        """Whether there is anything to trim."""
        return self.begin is not None or self.end is not None


@dataclass(frozen=True, slots=True)
class TrimOrder:
    """What is being trimmed out, complete in itself; network, precision and windows say whose playback reads it."""

    excerpt: Excerpt
    model_id: str
    precision: Precision
    policy: Policy


@dataclass(frozen=True, slots=True)
class RecordingState:
    """A browser keeps none of this: a page that comes back costs nothing, nor does a link that is followed."""

    view: ClassVar[str] = "recording"
    examines: bool = passing(False, can_be_set=True)
    """Whether the recording's statistics are computed and shown."""
    fits: bool = passing(False, can_be_set=True)
    """Whether the sensor's statistics are held against the training range."""
    excerpt: Excerpt = passing(default_factory=Excerpt)
    cut: TrimOrder | None = passing(None)


def reduce_recording(slice_: RecordingState, intent: Any, here: Here) -> RecordingState:
    """Marks in the wrong order are no stretch: the one that was set last stays."""
    state = here.state
    match intent:
        case ask.ShowWorkspace("recording"):
            return replace(slice_, examines=True, fits=True)
        case MarkTrim(end):
            if here.window is None:
                return slice_
            return replace(slice_, excerpt=_marked(slice_.excerpt, end, state.recording_id, here.window), cut=None)
        case Trim():
            is_here = slice_.excerpt.is_marked and slice_.excerpt.recording_id == state.recording_id
            return replace(slice_, cut=_order(state, slice_.excerpt)) if is_here else slice_
        case DropTrim():
            return replace(slice_, cut=None)
        case Downloaded(slot) if slot == TRIM_SLOT:
            return replace(slice_, cut=None)
        case ask.RenameRecording(recording_id) if slice_.excerpt.recording_id == state.recording_id:
            # A part's events have the numbers of the whole.
            return replace(slice_, excerpt=replace(slice_.excerpt, recording_id=recording_id))
    return slice_


def _order(state: ViewState, excerpt: Excerpt) -> TrimOrder | None:
    return None if state.policy is None else TrimOrder(excerpt, state.model_id, state.precision, state.policy)


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


_WORDS: dict[str, Any] = {
    "from": MarkTrim("from"),
    "to": MarkTrim("to"),
    "trim": Trim(),
    "drop": DropTrim(),
}


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    return _WORDS.get(words)
