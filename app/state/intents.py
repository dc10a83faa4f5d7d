"""What a person can ask of the page as a whole. An intent is a value; reducers say what it means.

What a person can ask of one view stands in that view's `state.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from app.engine.requests import Precision
from app.state.view_state import Workspace
from etnet.events.cleaning import Cleaning
from etnet.windows import Policy

Intent = Any
"""Any frozen value that a reducer understands. One that says `pauses` also stops the player."""


@dataclass(frozen=True, slots=True)
class Set:
    """Set one plain field of a view's slice; a value that does not fit changes nothing.

    `value` is what the field takes, or, with `is_word`, the word of it that our own HTML sends.
    """

    view: str
    field: str
    value: object
    is_word: bool = False


@dataclass(frozen=True, slots=True)
class OpenRecording:
    """Show another recording, by its catalogue id, from its first window."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class ReopenRecording:
    """Show the same recording opened in another way, by its id; the current moment stays where it is in time."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class ChooseModel:
    """Reconstruct with another network, by its catalogue id."""

    model_id: str


@dataclass(frozen=True, slots=True)
class ChoosePrecision:
    """Run the network in this precision; "auto" takes the faster one of those that agree."""

    precision: Precision


@dataclass(frozen=True, slots=True)
class ChoosePolicy:
    """Cut the events into other windows; the moment stays where it is in time. `None` takes what suits."""

    policy: Policy | None


@dataclass(frozen=True, slots=True)
class ChooseCleaning:
    """Take noise out of the events first; the moment stays where it is in time. `Cleaning()` takes out none."""

    cleaning: Cleaning


@dataclass(frozen=True, slots=True)
class RenameRecording:
    """The open recording has another id than before: that of a part of it, or of all of it at last."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class Settle:
    """The recording is open: take `policy` where none was chosen, and bring everything within its limits."""

    policy: Policy


@dataclass(frozen=True, slots=True)
class Seek:
    """Go to a window and stop playing."""

    index: int


@dataclass(frozen=True, slots=True)
class SeekTime:
    """Go to the window that is current `seconds` after the recording's first event, and stop playing."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Move:
    """Go some windows forward (or back, when negative) and stop playing."""

    num_windows: int


@dataclass(frozen=True, slots=True)
class TogglePlay:
    """Play, or pause. Playing from the last window starts over; where that is now, it is followed."""


@dataclass(frozen=True, slots=True)
class FollowNewest:
    """Go to the newest window of a live recording, and with it from now on."""


@dataclass(frozen=True, slots=True)
class PlayTo:
    """Playing has come to this window. Past the last one it loops or stops."""

    index: int


@dataclass(frozen=True, slots=True)
class ChooseSpeed:
    """Recording seconds per second. `waits_for_frames` shows every window and waits for its reconstruction."""

    speed: float
    waits_for_frames: bool = False


@dataclass(frozen=True, slots=True)
class SetLoop:
    """Whether playing starts over at the end."""

    loops: bool


MarkName = Literal["a", "b"]


@dataclass(frozen=True, slots=True)
class MarkHere:
    """Begin the marked stretch with the current window ("a"), or end it with that ("b")."""

    mark: MarkName


@dataclass(frozen=True, slots=True)
class PutMark:
    """Put a mark at so many seconds after the recording's first event."""

    mark: MarkName
    seconds: float


@dataclass(frozen=True, slots=True)
class ClearMarks:
    """Take both marks away: the stretch is the whole recording."""


@dataclass(frozen=True, slots=True)
class ShowWorkspace:
    """Arrange the page for another purpose."""

    workspace: Workspace


@dataclass(frozen=True, slots=True)
class OpenTab:
    """Open the settings of one view in the inspector column, by the view's name."""

    tab: str


@dataclass(frozen=True, slots=True)
class StageCard:
    """Send a card of the shelf to the stage, or back."""

    card: str


@dataclass(frozen=True, slots=True)
class Query:
    """Choose the pixel (x, y) of the sensor that views are about; clamped to it."""

    x: int
    y: int


@dataclass(frozen=True, slots=True)
class QueryFraction:
    """As `Query`, at fractions 0 … 1 of the sensor's width and height."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class MoveQuery:
    """Move the chosen pixel by (x, y) pixels, as far as the sensor reaches."""

    x: int
    y: int


@dataclass(frozen=True, slots=True)
class NetworkKnown:
    """What the chosen network has, told by the answer of a job: its attention sites in order, and heads of a site."""

    pauses: ClassVar[bool] = False

    sites: tuple[str, ...]
    num_heads: int


@dataclass(frozen=True, slots=True)
class FormChanged:
    """A form that its own widgets keep has changed; the page is drawn again around it."""

    pauses: ClassVar[bool] = False
