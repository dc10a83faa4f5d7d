"""Which attention map is shown and how: a slice of the page, its intents, and what its own buttons say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast, get_args

from app.html.attention.look import AttentionLook, Direction, Gather, MapRange, Order
from app.state import intents as ask
from app.state.checks import checked, number, passing, restored, text, whole
from app.state.view_state import ViewState
from app.views.reconstruction.state import tones_in
from app.views.view import Here

if TYPE_CHECKING:
    from app.views.page import Page

Pin = Literal["a", "b"]
SITE_PATTERN = r"scale[0-3]\.(encoder|decoder)\.\d{1,2}\.(self|cross)"
MOST_HEADS = 64


@dataclass(frozen=True, slots=True)
class PinnedMap:
    """A map that stays to be compared: its site, its head (`None`: gathered over heads) and its query pixel."""

    site: str = text("scale1.encoder.0.self", SITE_PATTERN)
    head: int | None = whole(None, 0, MOST_HEADS - 1)
    gather: Gather = "mean"
    query: tuple[int, int] = (0, 0)


@dataclass(frozen=True, slots=True)
class AttentionState:
    """One visitor's look at attention. What is pinned does not outlive the visit."""

    view: ClassVar[str] = "attention"
    site: str = text("scale1.encoder.0.self", SITE_PATTERN)
    head: int | None = whole(None, 0, MOST_HEADS - 1)
    """`None` is all heads, gathered."""
    opens_heads: bool = False
    """Whether the site is shown large, with its heads beside each other."""
    overlay: float = number(0.8, 0.0, 1.0)
    map_range: MapRange = "shared"
    gather: Gather = "mean"
    order: Order = "network"
    direction: Direction = "reads"
    is_linear: bool = False
    is_smooth: bool = False
    shows_links: bool = False
    """Whether lines in the scene join the query to what it reads most."""
    shows_planes: bool = False
    """Whether the chosen layer's maps of all scales stand behind the frame, instead of the events."""
    pin_a: PinnedMap | None = passing(None)
    pin_b: PinnedMap | None = passing(None)


@dataclass(frozen=True, slots=True)
class OpenSite:
    """Show this attention site ("scale1.encoder.0.self") large, with its heads beside each other."""

    site: str


@dataclass(frozen=True, slots=True)
class PinMap:
    """Keep a map as A or B; `None` unpins."""

    slot: Pin
    pinned: PinnedMap | None


def reduce_attention(slice_: AttentionState, intent: Any, here: Here) -> AttentionState:
    """Pins are about one recording, network and plan of windows."""
    match intent:
        case OpenSite():
            return _opened(slice_, intent.site)
        case PinMap("a", pinned):
            return replace(slice_, pin_a=pinned)
        case PinMap("b", pinned):
            return replace(slice_, pin_b=pinned)
        case ask.OpenRecording() | ask.ReopenRecording() | ask.ChooseModel() | ask.ChoosePolicy():
            return replace(slice_, pin_a=None, pin_b=None)
    return slice_


def _opened(slice_: AttentionState, site: str) -> AttentionState:
    try:
        return replace(slice_, site=checked(AttentionState, "site", site), opens_heads=True)
    except ValueError:
        return slice_


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    verb, _, rest = words.partition(":")
    match verb:
        case "site":
            return OpenSite(rest)
        case "sites":
            return ask.Set("attention", "opens_heads", False)
        case "unpin" if rest in get_args(Pin):
            return PinMap(cast("Pin", rest), None)
        case "pin":
            slot, _, pinned = rest.partition(":")
            found = _pinned(pinned)
            return PinMap(cast("Pin", slot), found) if slot in get_args(Pin) and found is not None else None
    return None


def pin_text(pinned: PinnedMap) -> str:
    """A pin as a button says it."""
    head = pinned.gather if pinned.head is None else str(pinned.head)
    return f"{pinned.site},{head},{pinned.query[0]},{pinned.query[1]}"


def _pinned(words: str) -> PinnedMap | None:
    site, head, x, y = words.split(",") if words.count(",") == 3 else ("", "", "", "")
    if not all(part.isascii() and part.isdecimal() and len(part) < 7 for part in (x, y)):
        return None
    kind: dict[str, object] = {"gather": head} if head in get_args(Gather) else {"head": _whole(head)}
    found, refused = restored(PinnedMap(), {"site": site, "query": [int(x), int(y)], **kind})
    return None if refused else found


def _whole(word: str) -> object:
    return int(word) if word.isascii() and word.isdecimal() and len(word) < 7 else word


def look_in(state: ViewState, is_linear_light: bool) -> AttentionLook | None:
    """How a visitor looks at attention; `None` before a pixel is chosen."""
    if state.query is None:
        return None
    slice_ = state.of(AttentionState)
    return AttentionLook(
        state.query,
        slice_.head,
        slice_.overlay,
        slice_.map_range,
        tones_in(state, is_linear_light),
        slice_.gather,
        slice_.order,
        slice_.direction if slice_.opens_heads else "reads",
        slice_.is_linear,
        slice_.is_smooth,
    )


def look_of(page: Page) -> AttentionLook | None:
    """How a visitor looks at the attention of the page's network."""
    return look_in(page.state, page.model.is_linear_light)
