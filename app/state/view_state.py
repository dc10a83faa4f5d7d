"""All that one visitor's page depends on, as a value: the moment that all views share, and a slice for each view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Literal, Protocol, TypeVar, get_args

from app.engine.requests import Precision
from app.state.checks import number, passing, text, whole
from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.events import Sensor
from etnet.stretch import nearest_window, windows_between
from etnet.windows import Policy, Window

Workspace = Literal["inspect", "attention", "compare", "recording", "demo"]
LARGEST_INDEX = 10**9


class Slice(Protocol):
    """What one view keeps of a visitor's page: a frozen dataclass that can be made without arguments."""

    view: ClassVar[str]
    """The view's name."""


S = TypeVar("S", bound=Slice)


@dataclass(frozen=True, slots=True)
class Limits:
    """What the open recording allows. Before it is open nothing is known, and an index is left as it is."""

    sensor: Sensor | None = None
    windows: Sequence[Window] | None = None
    start: int = 0
    """Stamp of the recording's first event, µs: second 0 of the timeline."""
    is_growing: bool = False
    """More windows will come after the last one."""
    is_live: bool = False
    """A source feeds it: the newest window is now."""

    def clamp_index(self, index: int) -> int:
        """The nearest window that exists."""
        if self.windows is None:
            return max(index, 0)
        return min(max(index, 0), max(len(self.windows) - 1, 0))

    def index_at(self, t: int) -> int:
        """The window whose frame stamp (`t_stop`) is nearest to `t` µs; the earlier of two equally near."""
        return nearest_window(self.windows, t) if self.windows else 0

    def stretch(self, begin: int | None, end: int | None) -> range:
        """The windows that end after stamp `begin` and not after `end` (µs); `None` is the recording's own end.

        Where no window ends between the two it is the one nearest to `end`; empty while nothing is known.
        """
        if not self.windows:
            return range(0)
        found = windows_between(self.windows, begin, end)
        if found:
            return found
        nearest = self.clamp_index(found.start) if end is None else self.index_at(end)
        return range(nearest, nearest + 1)

    def window(self, index: int) -> Window | None:
        """The window of an index, as far as any is known."""
        return self.windows[self.clamp_index(index)] if self.windows else None


@dataclass(frozen=True, slots=True)
class ViewState:
    """One visitor's page. Equal states show equal pages."""

    recording_id: str = text("")
    model_id: str = text("")
    precision: Precision = "fp32"
    policy: Policy | None = None
    """`None` until the recording is open, which then says what suits it."""
    index: int = whole(0, 0, LARGEST_INDEX)
    moment: int | None = passing(None)
    """Stamp (µs) to return to once the windows are planned."""
    is_playing: bool = passing(False)
    follows_newest: bool = True
    """Of a live recording: the newest window is the current one, whichever that is."""
    speed: float = number(0.1, 1e-4, 16.0)
    waits_for_frames: bool = False
    loops: bool = True
    cleaning: Cleaning = UNCLEANED
    """What is taken out of the events before anything is made of them."""
    mark_a: int | None = None
    """Stamp (µs, on the recording's clock) where the marked stretch begins; `None` is the recording's first event."""
    mark_b: int | None = None
    """Where it ends; what loops, is trimmed out or exported lies between the marks."""
    workspace: Workspace = "inspect"
    tab: str = text("", longest=60)
    """The view whose settings are open in the inspector column; empty takes the workspace's first."""
    staged: str = text("", longest=60)
    """The card that was sent from the shelf to the stage; empty leaves the stage as its workspace has it."""
    query: tuple[int, int] | None = None
    """Pixel (x, y) of the sensor that attention and inspectors are about."""
    is_public: bool = passing(False)
    """The page stands in public; it was started so, and no visitor can change that."""
    visit: int = passing(0)
    """Counts the visitors of a page in public; with each, everything starts over."""
    slices: tuple[Any, ...] = passing(())
    """One for each view that is not as it began, by the views' names. Read them with `of`, change them with `put`."""

    def of(self, kind: type[S]) -> S:
        """The slice of one view."""
        for slice_ in self.slices:
            if type(slice_) is kind:
                return slice_
        return kind()

    def put(self, *slices: Slice) -> ViewState:
        """The same with these slices in place of the former ones."""
        held = {slice_.view: slice_ for slice_ in self.slices}
        held |= {slice_.view: slice_ for slice_ in slices}
        kept = tuple(held[name] for name in sorted(held) if held[name] != type(held[name])())
        return replace(self, slices=kept)


SHARED_FIELDS = tuple(entry.name for entry in fields(ViewState) if entry.name != "slices")


def choices(alias: object) -> tuple[str, ...]:
    """The words of a `Literal`, in order: what a dropdown offers and what a stored state may hold."""
    return get_args(alias)
