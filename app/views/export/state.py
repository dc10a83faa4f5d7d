"""What is being exported: its form, and the order that is complete in itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal

from app.engine.downloads import Downloaded
from app.engine.requests import FrameRequest, Precision
from app.state.checks import passing
from app.state.run import Run
from app.state.view_state import Limits, ViewState
from app.views.inspect.state import NO_CHANGE, Change, InspectState
from app.views.view import Here
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.windows import Policy

NOTHING_KNOWN = Limits()
EXPORT_SLOT = "export.file"
ExportFormat = Literal["mp4", "gif", "png", "npz", "h5", "csv", "page", "session"]
ArrayName = Literal["frames", "voxels", "camera", "attention", "states"]
"""Those of `etnet.export.arrays`, which needs torch."""
DRAWN: tuple[ExportFormat, ...] = ("mp4", "gif", "png")
RANGED: tuple[ExportFormat, ...] = ("mp4", "gif", "page", "npz", "h5", "csv", "session")
"""What is made of the stretch between the marks."""
Sheet = Literal["panels", "voxels", "attention", "layout"]
"""What a picture of the moment shows: panels side by side, as in a video, or what else stands in the page."""
Panels = tuple[Literal["events", "reconstruction", "camera"], ...]


@dataclass(frozen=True, slots=True)
class OrderedRun:
    """One of the runs that stand side by side in what is drawn; the first is the page's own."""

    request: FrameRequest
    run: Run = field(default_factory=Run)
    source: str = ""
    """What the command line calls its network."""
    number: int = 0
    """Its letter on the stage, 0 is A."""


@dataclass(frozen=True, slots=True)
class StartExport:
    """Make a file of the current recording, in the background.

    `first` … `last` are windows, both included; `None` takes the recording's ends. `speed` is a share of real time.
    """

    pauses: ClassVar[bool] = True
    """Playing and exporting would both want the network."""
    format: ExportFormat
    first: int | None = None
    last: int | None = None
    panels: Panels = ("reconstruction",)
    speed: float = 0.1
    has_stamps: bool = False
    scale: int = 1
    """Whole pixels on a pixel's side."""
    fps: float | None = None
    """Frames a second; `None` shows each window once where windows are even."""
    arrays: tuple[ArrayName, ...] = ("frames", "voxels", "attention")
    """Attention is that of the chosen pixel, and left out while there is none."""
    sheet: Sheet = "panels"
    """Of a picture of one moment."""
    pixel: tuple[int, int] | None = None
    """Of which pixel a sheet's maps are; `None`: of the chosen one. One that is followed lies elsewhere by now."""
    runs: tuple[OrderedRun, ...] = ()
    """The runs that are compared, each with its name where the reconstruction would stand; empty for the page's own."""

    @property
    def is_replayed(self) -> bool:
        """Whether the runs see a protocol's windows, and not the timeline's."""
        return bool(self.runs) and self.runs[0].run.replays is not None


@dataclass(frozen=True, slots=True)
class DropExport:
    """What is being made is not wanted any more."""


@dataclass(frozen=True, slots=True)
class Order:
    """What was asked for, and of what: complete in itself, whatever the page shows meanwhile."""

    wanted: StartExport
    recording_id: str
    model_id: str
    precision: Precision
    policy: Policy
    index: int
    query: tuple[int, int] | None = None
    change: Change = NO_CHANGE
    """What was done to the network on purpose; a session holds it, if a run can (`Change.run_from`)."""
    cleaning: Cleaning = UNCLEANED
    marks: tuple[int | None, int | None] = (None, None)
    """The timeline's marks, µs: the range where the runs' windows are not the timeline's."""
    view: ViewState | None = None
    """How things were shown, for what is drawn; `None` for all that does not depend on it."""


@dataclass(frozen=True, slots=True)
class ExportState:
    """`None` while nothing is being made."""

    view: ClassVar[str] = "export"
    order: Order | None = passing(None)


def reduce_export(slice_: ExportState, intent: Any, here: Here) -> ExportState:
    """In public nothing is handed out."""
    match intent:
        case StartExport():
            return slice_ if here.state.is_public else replace(slice_, order=order_of(here.state, intent, here.limits))
        case DropExport():
            return replace(slice_, order=None)
        case Downloaded(slot) if slot == EXPORT_SLOT:
            return replace(slice_, order=None)
    return slice_


def order_of(state: ViewState, wanted: StartExport, limits: Limits = NOTHING_KNOWN) -> Order | None:
    """The order for what a page shows; `None` before its windows are known."""
    if state.policy is None:
        return None
    is_marked = state.mark_a is not None or state.mark_b is not None
    if is_marked and limits.windows and wanted.format in RANGED and wanted.first is wanted.last is None:
        stretch = limits.stretch(state.mark_a, state.mark_b)
        wanted = replace(wanted, first=stretch[0], last=stretch[-1])
    is_sheet = wanted.format == "png" and wanted.sheet != "panels"
    is_drawn = wanted.format in DRAWN or is_sheet
    view = replace(state.put(ExportState()), is_playing=False) if is_drawn else None
    of = state.recording_id, state.model_id, state.precision, state.policy, state.index
    marks = state.mark_a, state.mark_b
    return Order(wanted, *of, state.query, state.of(InspectState).change, state.cleaning, marks, view)


def arrays_of(wanted: StartExport, query: tuple[int, int] | None) -> tuple[ArrayName, ...]:
    """The arrays that can be written with this pixel, or none, chosen."""
    return tuple(name for name in wanted.arrays if name != "attention" or query is not None)
