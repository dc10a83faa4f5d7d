"""What a person can ask of the viewer. An intent is a value; `view_state.reduce` says what it means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from app.views.compare.state import CompareIntent
from app.views.demo.state import DemoIntent
from app.views.inspect.state import InspectIntent
from app.views.recording.state import RecordingIntent
from etnet.windows import Policy

Workspace = Literal["inspect", "attention", "demo"]
Precision = Literal["auto", "fp32", "bf16"]
EventImage = Literal["polarity", "count", "time surface", "decay"]
Tone = Literal["auto", "raw", "robust", "gamma", "hdr", "clahe"]
Camera = Literal["orbit", "front", "side"]
MapRange = Literal["shared", "per map"]


@dataclass(frozen=True, slots=True)
class OpenRecording:
    """Show another recording, by its catalogue id, from its first window."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class ReopenRecording:
    """Show the same scene as another sensor sees it, by its id; the moment on show stays where it is in time."""

    recording_id: str


@dataclass(frozen=True, slots=True)
class ChooseModel:
    """Reconstruct with another model, by its catalogue id."""

    model_id: str


@dataclass(frozen=True, slots=True)
class ChoosePrecision:
    """Run the model in this precision; "auto" takes the faster one."""

    precision: Precision


@dataclass(frozen=True, slots=True)
class ChoosePolicy:
    """Cut the events into other windows; the moment on show stays where it is in time. `None` suits the recording."""

    policy: Policy | None


@dataclass(frozen=True, slots=True)
class RenameRecording:
    """What is open of the recording on show is known by another id than before: a part of it, or all at last."""

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
    """Go to the window that is on show `seconds` after the recording's first event, and stop playing."""

    seconds: float


@dataclass(frozen=True, slots=True)
class Move:
    """Go some windows on (or back, when negative) and stop playing."""

    num_windows: int


@dataclass(frozen=True, slots=True)
class TogglePlay:
    """Play, or pause. Playing from the last window starts over."""


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


@dataclass(frozen=True, slots=True)
class ShowWorkspace:
    """Arrange the page for another purpose."""

    workspace: Workspace


@dataclass(frozen=True, slots=True)
class Query:
    """Ask where the network looks from pixel (x, y) of the sensor; clamped to it."""

    x: int
    y: int


@dataclass(frozen=True, slots=True)
class QueryFraction:
    """As `Query`, at fractions 0 … 1 of the sensor's width and height."""

    x: float
    y: float


@dataclass(frozen=True, slots=True)
class OpenSite:
    """Show this attention site ("scale1.encoder.0.self") large, with its heads beside each other."""

    site: str


@dataclass(frozen=True, slots=True)
class ChooseHead:
    """Show one head, or the mean of all (`None`)."""

    head: int | None


@dataclass(frozen=True, slots=True)
class CloseSite:
    """Show all attention sites again."""


@dataclass(frozen=True, slots=True)
class ChooseEventImage:
    """Draw the window's events in another way."""

    event_image: EventImage


@dataclass(frozen=True, slots=True)
class ChooseTone:
    """Map the network's raw output to grey values in another way."""

    tone: Tone


@dataclass(frozen=True, slots=True)
class SetOverlay:
    """How strongly attention covers the frame below it, 0 … 1."""

    opacity: float


@dataclass(frozen=True, slots=True)
class ChooseMapRange:
    """One colour range for all maps, or one for each."""

    map_range: MapRange


@dataclass(frozen=True, slots=True)
class ChooseCamera:
    """Look at the scene from a preset. Asking for the same one again puts the camera back."""

    camera: Camera


@dataclass(frozen=True, slots=True)
class ShowEvents:
    """Whether the event cloud is drawn in the scene."""

    is_shown: bool


@dataclass(frozen=True, slots=True)
class OpenBin:
    """Enlarge one voxel bin; `None` shows all again."""

    voxel_bin: int | None


Intent = (
    OpenRecording
    | ReopenRecording
    | ChooseModel
    | ChoosePrecision
    | ChoosePolicy
    | RenameRecording
    | Settle
    | Seek
    | SeekTime
    | Move
    | TogglePlay
    | PlayTo
    | ChooseSpeed
    | SetLoop
    | ShowWorkspace
    | Query
    | QueryFraction
    | OpenSite
    | CloseSite
    | ChooseHead
    | ChooseEventImage
    | ChooseTone
    | SetOverlay
    | ChooseMapRange
    | ChooseCamera
    | ShowEvents
    | OpenBin
    | InspectIntent
    | CompareIntent
    | DemoIntent
    | RecordingIntent
)
