"""The contract of a view, one part of the page: all that session, link, stored view and layout know of it.

One intent, one new page: the shared moment first, then the slices of the views that hear it. Nothing else may change
a page.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

from app.catalogue.visitor import VisitorCatalogue
from app.engine.jobs import Job
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.html.pictures import EventCloud
from app.state import intents as ask
from app.state.checks import checked, with_word
from app.state.reduce import reduce_shared
from app.state.run import Run
from app.state.view_state import Limits, Slice, ViewState, Workspace
from app.views.page import Page, RunFrame
from etnet.windows import Window

if TYPE_CHECKING:
    import viser

    from app.views.panel import Panel


EVERYWHERE: frozenset[Workspace] = frozenset({"inspect", "attention", "compare", "recording", "demo"})
EXPERT: frozenset[Workspace] = EVERYWHERE - {"demo"}
NOWHERE: frozenset[Workspace] = frozenset()
NumSeen = Callable[[FrameRequest], int]
"""How many frames of a request's playback exist."""


@dataclass(frozen=True, slots=True)
class Here:
    """The page before an intent, and what its recording allows."""

    state: ViewState
    limits: Limits

    @property
    def window(self) -> Window | None:
        """The current window, as far as any is known."""
        return self.limits.window(self.state.index)


@dataclass(frozen=True, slots=True)
class Card:
    """A picture of the page, by name: large on the stage or small on the shelf, in these workspaces."""

    name: str
    stage: frozenset[Workspace] = NOWHERE
    shelf: frozenset[Workspace] = NOWHERE


@dataclass(frozen=True, slots=True)
class Command:
    """Something to do by its name in the list of commands, or by a key."""

    label: str
    key: str | None
    intent: Any
    """What it asks for; several in a row are a tuple."""


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


def _no_runs(state: ViewState) -> tuple[Run, ...] | None:
    return None


def _no_run_jobs(state: ViewState, moment: Moment, runs: Sequence[RunFrame], num_seen: NumSeen) -> Mapping[str, Job]:
    return {}


def _as_asked(slice_: Any, request: FrameRequest) -> FrameRequest:
    return request


def _nothing_over(page: Page) -> str:
    return ""


def _nothing_done(intent: Any, catalogue: VisitorCatalogue) -> None:
    return None


def _for_everything(page: Page) -> bool:
    return True


def _for_none(catalogue: VisitorCatalogue, recording_id: str) -> bool:
    return False


def _no_cloud(page: Page) -> Callable[[int], EventCloud] | None:
    return None


@dataclass(frozen=True, slots=True)
class View:
    """One part of the page. `name` is its folder, its slice, its key in links and stored views and its CSS prefix."""

    name: str
    title: str
    icon: str
    """A name of viser's icons."""
    initial: Slice
    make_panel: Callable[[viser.ClientHandle], Panel]
    """Imports viser: called when a page is laid out."""
    workspaces: frozenset[Workspace] = NOWHERE
    """Where it stands in the page itself, always open."""
    settings_in: frozenset[Workspace] = NOWHERE
    """Where its settings are one tab of the inspector column."""
    suits: Callable[[Page], bool] = _for_everything
    """Whether its settings are for what is open: elsewhere their tab is left out."""
    cards: tuple[Card, ...] = ()
    at_foot: bool = False
    """Whether it stands in a panel of its own below the page, and not in it."""
    commands: tuple[Command, ...] = ()
    """What a key, or the list of commands, asks of it."""
    opens_for: Callable[[VisitorCatalogue, str], bool] = _for_none
    """Whether its tab opens with a recording of this id that a visitor has handed over."""
    is_public: bool = False
    """Whether it is part of a page in public, where a visitor may change it."""
    in_public: Slice | None = None
    """How its slice begins there; `None`: as elsewhere."""
    reduce: Reducer = _unchanged
    """Is asked for the intents of its own `state.py`, for what sets a field of its slice, and for `intents`."""
    intents: tuple[type, ...] = ()
    """What it hears beside its own: intents of the page, and of what lies below the views."""
    hear: Callable[[str], Any] = _nothing_heard
    """A click on HTML of its own, `data-k="name:words"` → an intent; `None` for words that it does not use."""
    jobs: Callable[[ViewState, FrameRequest], Mapping[str, Job]] = _no_jobs
    """What it wants computed, by slot; asked only while the view is open."""
    background_jobs: Callable[[ViewState, FrameRequest], Mapping[str, Job]] = _no_jobs
    """Files that were ordered: they are made whether the view is open or not."""
    change_request: Callable[[Any, FrameRequest], FrameRequest] = _as_asked
    """What it changes in every request for a frame: an intervention, a filter."""
    runs: Callable[[ViewState], tuple[Run, ...] | None] = _no_runs
    """The runs that it compares, the main one first; `None` while it compares nothing."""
    run_jobs: Callable[[ViewState, Moment, Sequence[RunFrame], NumSeen], Mapping[str, Job]] = _no_run_jobs
    """What it wants computed of these runs, or of all that the moment's recording holds by now."""
    over_timeline: Callable[[Page], str] = _nothing_over
    """SVG that it draws over the timeline; asked where its slice is not as it began, or it has an answer."""
    perform: Callable[[Any, VisitorCatalogue], None] = _nothing_done
    """What an intent does beyond the page: to a source, to a file of the host's. Asked before `reduce`; never waits."""
    cloud: Callable[[Page], Callable[[int], EventCloud] | None] = _no_cloud
    """The events of the scene in colours of its own, for a number of points at most; asked as `over_timeline` is."""

    def of(self, state: ViewState) -> Any:
        """Its slice of a page's state."""
        return state.of(type(self.initial))

    def hears(self, intent: Any) -> bool:
        """Whether an intent may say something to its slice."""
        kind = type(intent)
        return kind in self.intents or kind.__module__ == type(self.initial).__module__


def tabs(state: ViewState, views: Sequence[View]) -> tuple[View, ...]:
    """The views whose settings can be opened in the inspector column, in order."""
    return tuple(
        view for view in views if state.workspace in view.settings_in and (view.is_public or not state.is_public)
    )


def touched_views(state: ViewState, views: Sequence[View]) -> tuple[View, ...]:
    """The views whose slice is not as it began: only these can have changed a request or ordered a file."""
    touched = {slice_.view for slice_ in state.slices}
    return tuple(view for view in views if view.initial.view in touched)


def changing_views(state: ViewState, views: Sequence[View]) -> tuple[View, ...]:
    """The touched views that change requests for frames: what they mark on the timeline is seen in every workspace."""
    return tuple(view for view in touched_views(state, views) if view.change_request is not _as_asked)


def speaking_views(state: ViewState, views: Sequence[View], results: Mapping[str, object]) -> tuple[View, ...]:
    """The open views that may have something to add to the timeline or the scene: touched, or with an answer.

    The slot of a view's answer begins with the view's name and a full stop.
    """
    owners = {slot.partition(".")[0] for slot in results} | {slice_.view for slice_ in state.slices}
    return tuple(view for view in open_views(state, views) if view.name in owners) if owners else ()


def open_tab(state: ViewState, views: Sequence[View]) -> View | None:
    """The one whose settings are open: as a visitor chose, else the first."""
    offered = tabs(state, views)
    return next((view for view in offered if view.name == state.tab), offered[0] if offered else None)


def open_views(state: ViewState, views: Sequence[View]) -> tuple[View, ...]:
    """The views that a visitor can see: those of the workspace, and one tab of the inspector column."""
    tab = open_tab(state, views)
    return tuple(
        view
        for view in views
        if view is tab or (state.workspace in view.workspaces and (view.is_public or not state.is_public))
    )


Area = Literal["a", "b", "s1", "s2", "s3", "s4", ""]


def areas(state: ViewState, views: Sequence[View]) -> dict[str, Area]:
    """Where each card stands: two on the stage, the others on the shelf, as far as it reaches. A shelf card that was
    sent to the stage changes places with the stage's second."""
    seen = [card for view in open_views(state, views) for card in view.cards]
    staged = [card.name for card in seen if state.workspace in card.stage]
    stage, shelf = staged[:2], staged[2:]
    shelf += [card.name for card in seen if state.workspace in card.shelf and card.name not in staged]
    if state.staged in shelf and stage:
        place = shelf.index(state.staged)
        stage[-1], shelf[place] = shelf[place], stage[-1]
    shelf_areas: tuple[Area, ...] = ("s1", "s2", "s3", "s4")
    stage_areas: tuple[Area, ...] = ("a", "b")
    places: dict[str, Area] = dict(zip(stage, stage_areas, strict=False))
    places.update(zip(shelf, shelf_areas, strict=False))
    return places


def reduce_views(state: ViewState, intent: Any, limits: Limits, views: Sequence[View]) -> ViewState:
    """The page after `intent`. Each view sees the page as it was before."""
    here = Here(state, limits)
    changed = []
    for view in views:
        is_set = isinstance(intent, ask.Set) and intent.view == view.name
        if not is_set and not view.hears(intent):
            continue
        before = view.of(state)
        # What was set goes through the view's own reducer, too: fields may depend on each other.
        after = view.reduce(_set(before, intent) if is_set else before, intent, here)
        if after is not before:
            changed.append(after)
    shared = reduce_shared(state, intent, limits)
    return shared.put(*changed) if changed else shared


def _set(slice_: Any, intent: ask.Set) -> Any:
    """A page may send anything; what does not fit changes nothing."""
    try:
        if intent.is_word:
            return with_word(slice_, intent.field, str(intent.value))
        return replace(slice_, **{intent.field: checked(type(slice_), intent.field, intent.value)})
    except ValueError:
        return slice_
