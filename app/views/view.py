"""The contract of a view: one part of the page. Session, link, stored view, layout and engine know nothing else of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.state.view_state import Limits, Slice, ViewState, Workspace
from etnet.windows import Window

if TYPE_CHECKING:
    from app.state.lane import Lane
    from app.views.panel import Panel

EVERYWHERE: frozenset[Workspace] = frozenset({"inspect", "attention", "compare", "recording", "demo"})
EXPERT: frozenset[Workspace] = EVERYWHERE - {"demo"}


@dataclass(frozen=True, slots=True)
class Here:
    """The page before an intent, and what its recording allows."""

    state: ViewState
    limits: Limits

    @property
    def window(self) -> Window | None:
        """The current window, as far as any is known."""
        return self.limits.window(self.state.index)


class Reducer(Protocol):
    """Pure: the slice after an intent, which may be another view's or the page's."""

    def __call__(self, slice_: Any, intent: Any, here: Here) -> Any:
        """The same slice where the intent says nothing to it."""
        ...


def _unchanged(slice_: Any, intent: Any, here: Here) -> Any:
    return slice_


def _nothing_heard(words: str) -> Any:
    return None


def _no_jobs(state: ViewState, request: FrameRequest) -> Mapping[str, Job]:
    return {}


def _no_lanes(state: ViewState) -> tuple[Lane, ...] | None:
    return None


def _as_asked(slice_: Any, request: FrameRequest) -> FrameRequest:
    return request


@dataclass(frozen=True, slots=True)
class View:
    """One part of the page. `name` is its folder, its slice, its key in links and stored views and its CSS prefix."""

    name: str
    title: str
    icon: str
    """A name of viser's icons."""
    initial: Slice
    make_panel: Callable[[], Panel]
    """Imports viser: called when a page is laid out."""
    workspaces: frozenset[Workspace] = EXPERT
    """Where it can be seen."""
    is_tab: bool = False
    """Whether it stands in the inspector column, open or closed; otherwise it is always open in its workspaces."""
    is_public: bool = False
    """Whether it is part of a page in public, where a visitor may change it."""
    reduce: Reducer = _unchanged
    hear: Callable[[str], Any] = _nothing_heard
    """A click on HTML of its own, `data-k="name:words"` → an intent; `None` for words that it does not use."""
    jobs: Callable[[ViewState, FrameRequest], Mapping[str, Job]] = _no_jobs
    """What it wants computed, by slot; asked only while the view is open."""
    change_request: Callable[[Any, FrameRequest], FrameRequest] = _as_asked
    """What it changes in every request for a frame: an intervention, a filter."""
    lanes: Callable[[ViewState], tuple[Lane, ...] | None] = _no_lanes
    """The runs that it shows beside the main one; `None` while it compares nothing."""

    def of(self, state: ViewState) -> Any:
        """Its slice of a page's state."""
        return state.of(type(self.initial))


def open_views(state: ViewState, views: Sequence[View]) -> tuple[View, ...]:
    """The views that a visitor can see: all cards of the workspace, and one tab of the inspector column."""
    here = [view for view in views if state.workspace in view.workspaces and (view.is_public or not state.is_public)]
    tabs = [view for view in here if view.is_tab]
    tab = next((view for view in tabs if view.name == state.tab), tabs[0] if tabs else None)
    return tuple(view for view in here if not view.is_tab or view is tab)
