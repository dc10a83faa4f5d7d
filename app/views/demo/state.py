"""What the demo points at while nobody touches the page, and what a visitor has asked of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from app.engine.downloads import Downloaded
from app.state import intents as ask
from app.state.checks import passing
from app.state.view_state import ViewState
from app.views.export.state import Order, StartExport, order_of
from app.views.view import Here

Act = Literal["none", "events", "image", "places", "invite"]
Large = Literal["cloud", "map"]
"""What the large picture is: the events in space and time, or where the network looks."""
Sheet = Literal["", "mirror", "home"]
Guess = Literal["", "asked", "shown"]
HOME_SLOT = "demo.home"
HOME_SECONDS = 3.0
"""Of the recording around the moment, in the page that a visitor takes home."""
FIRST_SPOT = (0.58, 0.42)
"""Where the network is asked about first, as fractions of the picture."""


@dataclass(frozen=True, slots=True)
class PointAt:
    """The demo leads and points at one of its pictures; "none": a visitor leads."""

    act: Act


@dataclass(frozen=True, slots=True)
class ShowLarge:
    """Make this the large picture."""

    large: Large


@dataclass(frozen=True, slots=True)
class OpenSheet:
    """Lay this over the page; "" takes it away."""

    sheet: Sheet


@dataclass(frozen=True, slots=True)
class GuessFirst:
    """Hide the images until the visitors have guessed; then fade them in."""

    guess: Guess


@dataclass(frozen=True, slots=True)
class TakeHome:
    """Make the seconds around the moment into a page of their own."""

    pauses: ClassVar[bool] = True


@dataclass(frozen=True, slots=True)
class HomeReady:
    """The page to take home lies at this path of the server."""

    path: str


@dataclass(frozen=True, slots=True)
class DemoState:
    """The act that is played, and what a visitor opened."""

    view: ClassVar[str] = "demo"
    act: Act = passing("none")
    large: Large = passing("cloud")
    sheet: Sheet = passing("")
    guess: Guess = passing("")
    order: Order | None = passing(None)
    """The page to take home that is being made."""
    home: str = passing("")
    """The path of the one that is made; empty before."""


def reduce_demo(slice_: DemoState, intent: Any, here: Here) -> DemoState:
    """Only a page in public points at anything by itself."""
    match intent:
        case PointAt(act) if here.state.is_public:
            return DemoState(act, "map" if act == "places" else "cloud") if act != "none" else replace(slice_, act=act)
        case ask.Query() | ask.QueryFraction():
            return replace(slice_, large="map", guess="")
        case ShowLarge(large):
            return replace(slice_, large=large)
        case OpenSheet(sheet):
            return replace(slice_, sheet=sheet)
        case GuessFirst(guess):
            return replace(slice_, guess=guess, large="cloud", sheet="")
        case ask.OpenRecording():
            return replace(slice_, large="cloud", sheet="", order=None, home="")
        case TakeHome():
            return replace(slice_, sheet="home", home="", order=home_order(here))
        case HomeReady(path):
            return replace(slice_, home=path, order=None)
        case Downloaded(slot) if slot == HOME_SLOT:
            return replace(slice_, order=None)
    return slice_


def home_order(here: Here) -> Order | None:
    """The windows around the current one that make `HOME_SECONDS`; `None` before any is known."""
    state, windows = here.state, here.limits.windows
    if state.policy is None or not windows:
        return None
    first = here.limits.index_at(_middle(here) - round(HOME_SECONDS / 2 * 1e6))
    last = here.limits.index_at(windows[first].t_stop + round(HOME_SECONDS * 1e6))
    return order_of(state, StartExport("page", first, last))


def _middle(here: Here) -> int:
    window = here.window
    assert window is not None
    return window.t_stop


def opens_cloud(state: ViewState) -> bool:
    """Whether the demo shows the scene."""
    return state.of(DemoState).large == "cloud"


_WORDS: dict[str, Any] = {
    "play": ask.TogglePlay(),
    "cloud": ShowLarge("cloud"),
    "spot": ask.QueryFraction(*FIRST_SPOT),
    "mirror": OpenSheet("mirror"),
    "home": TakeHome(),
    "close": OpenSheet(""),
    "guess": GuessFirst("asked"),
    "reveal": GuessFirst("shown"),
    "guessed": GuessFirst(""),
}


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    return _WORDS.get(words)
