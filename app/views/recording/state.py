"""What looks after the recording itself: its statistics, and what is trimmed out of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from app.engine.downloads import Downloaded
from app.engine.requests import Precision
from app.state import intents as ask
from app.state.checks import passing
from app.state.view_state import Limits, ViewState
from app.views.view import Here
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.windows import Policy

TRIM_SLOT = "recording.trim"


@dataclass(frozen=True, slots=True)
class Trim:
    """Make what lies between the marks into a recording of its own, in the background."""


@dataclass(frozen=True, slots=True)
class DropTrim:
    """What is being trimmed out is not wanted any more."""


@dataclass(frozen=True, slots=True)
class Excerpt:
    """The marked stretch in whole windows: events start … stop − 1, and the stamps (µs) of its two ends."""

    recording_id: str
    start: int
    stop: int
    span: tuple[int, int]


@dataclass(frozen=True, slots=True)
class TrimOrder:
    """What is being trimmed out, complete in itself; network, precision and windows say whose playback reads it."""

    excerpt: Excerpt
    model_id: str
    precision: Precision
    policy: Policy
    cleaning: Cleaning = UNCLEANED


@dataclass(frozen=True, slots=True)
class RecordingState:
    """A browser keeps none of this: a page that comes back costs nothing, nor does a link that is followed."""

    view: ClassVar[str] = "recording"
    examines: bool = passing(False, can_be_set=True)
    """Whether the recording's statistics are computed and shown."""
    fits: bool = passing(False, can_be_set=True)
    """Whether the sensor's statistics are held against the training range."""
    cut: TrimOrder | None = passing(None)


def reduce_recording(slice_: RecordingState, intent: Any, here: Here) -> RecordingState:
    """What is trimmed out lies between the page's marks; another mark takes back an order that failed or runs."""
    match intent:
        case ask.ShowWorkspace("recording"):
            return replace(slice_, examines=True, fits=True)
        case ask.MarkHere() | ask.PutMark() | ask.ClearMarks() | DropTrim():
            return replace(slice_, cut=None) if slice_.cut is not None else slice_
        case Trim():
            return replace(slice_, cut=_order(here))
        case Downloaded(slot) if slot == TRIM_SLOT:
            return replace(slice_, cut=None)
    return slice_


def excerpt_of(state: ViewState, limits: Limits) -> Excerpt | None:
    """The windows between the marks; `None` while nothing is marked, or known. A mark that is missing is an end."""
    windows = limits.windows
    if (state.mark_a is None and state.mark_b is None) or not windows:
        return None
    stretch = limits.stretch(state.mark_a, state.mark_b)
    first, last = windows[stretch[0]], windows[stretch[-1]]
    return Excerpt(state.recording_id, first.start, last.stop, (first.t_start, last.t_stop))


def _order(here: Here) -> TrimOrder | None:
    state, excerpt = here.state, excerpt_of(here.state, here.limits)
    if state.policy is None or excerpt is None:
        return None
    return TrimOrder(excerpt, state.model_id, state.precision, state.policy, state.cleaning)


_WORDS: dict[str, Any] = {
    "trim": Trim(),
    "drop": DropTrim(),
}


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    return _WORDS.get(words)
