"""What every panel is: widgets that turn into intents, and pictures drawn from one value."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import viser

from app.catalogue.videos import VideoShown
from app.catalogue.visitor_uploads import UploadsShown
from app.engine.jobs import JobResult
from app.engine.requests import Failed, Ready, Working
from app.html.moment import Moment
from app.html.pictures import Tones
from app.html.provenance import ModelFacts
from app.state.intents import Intent
from app.state.view_state import ViewState
from app.views.attention.html.maps import AttentionLook
from app.views.compare.html.lane import LaneShown
from app.views.export.command import Run
from app.views.timeline.html import Cached
from etnet.errors import EtnetError

Dispatch = Callable[[Intent], None]


@dataclass(frozen=True, slots=True)
class Choice:
    """One entry of a list that a visitor chooses from: its id in the catalogue, and what he reads."""

    id: str
    title: str
    subtitle: str = ""


@dataclass(frozen=True, slots=True)
class Page:
    """Everything that one visitor's page is drawn from. `ready` may belong to another window than the one on show."""

    state: ViewState
    moment: Moment | None = None
    ready: Ready | None = None
    working: Working | None = None
    failed: Failed | None = None
    cached: Cached | None = None
    tones: Tones = field(default_factory=Tones)
    look: AttentionLook | None = None
    """`None` before a pixel was chosen."""
    model: ModelFacts = field(default_factory=lambda: ModelFacts("no network"))
    step_milliseconds: float | None = None
    is_moving: bool = False
    """A finger drags or the recording plays: what is drawn now is soon replaced."""
    recordings: tuple[Choice, ...] = ()
    models: tuple[Choice, ...] = ()
    trouble: str = ""
    """Why there is no moment, in plain words."""
    growing: tuple[str, ...] = ()
    """Names of recordings that are being written, and will be offered."""
    results: Mapping[str, JobResult] = field(default_factory=dict)
    """What is known of the jobs that this view wants, by slot."""
    lanes: tuple[LaneShown, ...] = ()
    """What is compared at this moment, the main lane first; empty while nothing is."""
    link: str = ""
    """The moment on show as a value for an address; empty while it moves."""
    desk: UploadsShown | None = None
    """The files that this visitor handed over; `None` where nothing is taken."""
    film: VideoShown | None = None
    """How far the video on show is simulated; `None` for what is no video."""
    run: Run | None = None
    """How the command line is told of what is on show; `None` for what it cannot open."""
    can_be_stated: bool = False
    """Whether the visitor may say of this recording what its file does not."""

    @property
    def missed(self) -> int | None:
        """The window whose image the one on show lags behind; `None` where each is waited for: it plays one behind."""
        return None if self.state.is_playing and self.state.waits_for_frames else self.state.index

    @property
    def lags(self) -> bool:
        """Whether the image on show belongs to another window than the one that is missed."""
        return self.ready is not None and self.missed not in (None, self.ready.request.index)


class Panel(Protocol):
    """A part of the page."""

    def build(self, gui: viser.GuiApi, dispatch: Dispatch) -> None:
        """Lay out the widgets, once."""
        ...

    def show(self, page: Page) -> None:
        """Draw what has changed. Called from the visitor's own thread."""
        ...


class Html:
    """One HTML element; it is sent only when it differs from what the page already has."""

    def __init__(self, gui: viser.GuiApi, content: str = "") -> None:
        self._handle = gui.add_html(content)
        self._content = content

    def show(self, content: str) -> None:
        """Replace the content in place."""
        if content != self._content:
            self._content = content
            self._handle.content = content

    def set_visible(self, is_visible: bool) -> None:
        """Show or hide the element."""
        if self._handle.visible != is_visible:
            self._handle.visible = is_visible


def on_visitor(handle: Any, act: Callable[[Any], Intent | None], dispatch: Dispatch) -> None:
    """PendingRequest a visitor's use of a widget into an intent; what the server itself assigns is no request of his.

    `act` gets the widget's value. It runs on viser's event loop and must only make a value.
    """

    async def heard(event: viser.GuiEvent[Any]) -> None:
        if event.client is None:
            return
        try:
            intent = act(event.target.value)
        except (TypeError, ValueError, LookupError, OverflowError, EtnetError):
            return  # no widget of ours sends such a value
        if intent is not None:
            dispatch(intent)

    handle.on_update(heard)


def on_press(button: viser.GuiButtonHandle, intent: Intent, dispatch: Dispatch) -> None:
    """PendingRequest a visitor's click into an intent."""

    async def pressed(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is not None:
            dispatch(intent)

    button.on_click(pressed)


def assign(handle: Any, value: object) -> None:
    """Let a widget show a value, unless it does, or the visitor's hand was on it a moment ago."""
    if handle.value != value and seconds_since_touched(handle) > 0.4:
        handle.value = value


def seconds_since_touched(handle: Any) -> float:
    """Seconds since the widget's value last changed, by whomever."""
    return time.time() - float(handle.update_timestamp)
