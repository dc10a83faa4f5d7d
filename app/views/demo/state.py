"""The part of a view that shows things to others: the demo's acts, and what is being taken away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from app.views.inspect.state import NO_CHANGE, Change
from etnet.windows import Policy

if TYPE_CHECKING:
    from app.state.view_state import ViewState

Act = Literal["none", "events", "image", "places"]
"""What the demo points at while nobody touches it."""


@dataclass(frozen=True, slots=True)
class PointAt:
    """The demo leads and points at one of its pictures; "none": a visitor leads."""

    act: Act


ExportFormat = Literal["mp4", "gif", "png", "npz", "h5", "csv", "page", "session"]
"""What can be taken away."""
ArrayName = Literal["frames", "voxels", "camera", "attention", "states"]
"""Those of `etnet.export.arrays`, which needs torch."""
Sheet = Literal["panels", "voxels", "attention", "layout"]
"""What a picture of the moment shows: panels side by side, as in a video, or what else stands in the page."""
Panels = tuple[Literal["events", "reconstruction", "camera"], ...]


@dataclass(frozen=True, slots=True)
class StartExport:
    """Make something of the recording on show to take home, in the background.

    `first` … `last` are windows, both included; `None` takes the recording's ends. `speed` is a share of real time.
    """

    parcel: ExportFormat
    first: int | None = None
    last: int | None = None
    panels: Panels = ("reconstruction",)
    speed: float = 0.1
    has_stamps: bool = False
    arrays: tuple[ArrayName, ...] = ("frames", "voxels", "attention")
    """Attention is that of the chosen pixel, and left out while there is none."""
    sheet: Sheet = "panels"
    """Of a picture of one moment."""


def arrays_of(wanted: StartExport, query: tuple[int, int] | None) -> tuple[ArrayName, ...]:
    """The arrays that can be written with this pixel, or none, chosen."""
    return tuple(name for name in wanted.arrays if name != "attention" or query is not None)


@dataclass(frozen=True, slots=True)
class DropExport:
    """What is being made is not wanted any more, or it has been handed over."""


@dataclass(frozen=True, slots=True)
class FormChanged:
    """The form of what is to be made has changed. It is kept by its widgets; the page is drawn anew around them."""


DemoIntent = PointAt | StartExport | DropExport | FormChanged


@dataclass(frozen=True, slots=True)
class Order:
    """What was asked for, and of what: complete in itself, whatever the page shows meanwhile."""

    wanted: StartExport
    recording_id: str
    model_id: str
    precision: Literal["auto", "fp32", "bf16"]
    policy: Policy
    index: int
    query: tuple[int, int] | None = None
    change: Change = NO_CHANGE
    """What was done to the network on purpose; a session holds it, if a run can (`Change.run_from`)."""
    view: ViewState | None = None
    """How things were shown, for a sheet; `None` for all that does not depend on it."""


@dataclass(frozen=True, slots=True)
class DemoState:
    """`is_demo`: the page stands in public; it was started so, and no visitor can change that."""

    is_demo: bool = False
    act: Act = "none"
    order: Order | None = None


def reduce_demo(show: DemoState, intent: DemoIntent, about: Callable[[StartExport], Order | None]) -> DemoState:
    """The part after `intent`; `about` completes an order by what is on show. In public nothing is handed out."""
    match intent:
        case StartExport():
            return show if show.is_demo else replace(show, order=about(intent))
        case DropExport():
            return replace(show, order=None)
        case FormChanged():
            return show
        case PointAt(act):
            return replace(show, act=act) if show.is_demo else show
