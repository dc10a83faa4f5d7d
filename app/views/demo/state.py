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
class HomeFailed:
    """The page to take home cannot be made; `why` in plain words."""

    why: str


@dataclass(frozen=True, slots=True)
class MirrorEnded:
    """The visitor's camera is off; `is_told`: there is something to say about it."""

    is_told: bool


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
    trouble: str = passing("")
    """Why there will be none."""


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
            return replace(_without_home(slice_), sheet=sheet)
        case MirrorEnded(is_told):
            return slice_ if slice_.sheet == "home" else replace(slice_, sheet="mirror" if is_told else "")
        case GuessFirst(guess):
            return replace(slice_, guess=guess, large="cloud", sheet="")
        case ask.OpenRecording():
            # A page that was ordered outlives what it was made of: the mirror ends by itself.
            kept = slice_ if slice_.sheet == "home" else replace(_without_home(slice_), sheet="")
            return replace(kept, large="cloud")
        case TakeHome():
            order = home_order(here)
            trouble = "" if order is not None else "Nothing is shown yet; try again in a moment."
            return replace(slice_, sheet="home", home="", trouble=trouble, order=order)
        case HomeReady(path):
            return replace(slice_, home=path, order=None)
        case HomeFailed(why):
            return replace(slice_, trouble=why, order=None)
        case Downloaded(slot) if slot == HOME_SLOT:
            return replace(slice_, order=None)
    return slice_


def _without_home(slice_: DemoState) -> DemoState:
    return replace(slice_, order=None, home="", trouble="")


def home_order(here: Here) -> Order | None:
    """The windows around the current one that make `HOME_SECONDS`, the last ones near the end of what there is; `None`
    before any is known."""
    state, windows, now = here.state, here.limits.windows, here.window
    if state.policy is None or not windows or now is None:
        return None
    seconds, end = round(HOME_SECONDS * 1e6), windows[len(windows) - 1].t_stop
    first = here.limits.index_at(min(now.t_stop - seconds // 2, end - seconds))
    last = here.limits.index_at(windows[first].t_stop + seconds)
    return order_of(state, StartExport("page", first, last))


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
