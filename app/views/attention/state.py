"""Which attention map is shown and how: a slice of the page, its intents, and what its own buttons say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, cast, get_args

from app.engine.requests import FrameRequest, Ready
from app.html.attention.look import (
    MOST_HEADS,
    SITE_PATTERN,
    AttentionLook,
    Direction,
    Gather,
    Keep,
    MapRange,
    Order,
    Weight,
)
from app.state import intents as ask
from app.state.checks import checked, number, passing, text, whole
from app.state.run import Run
from app.state.view_state import ViewState
from app.views.compare.state import CompareState
from app.views.inspect.state import InspectState, changed_request
from app.views.reconstruction.state import tones_in
from app.views.view import Here

if TYPE_CHECKING:
    from app.views.page import Page
    from app.views.stretch import Path

Pin = Literal["a", "b"]
Shelf = Literal["similarity", "pca"]
FeatureWord = Literal["tokens", "query", "key", "value", "context", "hidden 1", "hidden 2", "hidden 3"]
"""Which vectors similarity and colours are of: of the chosen site, of TPA's end, or of a recurrent level."""
Also = Literal["none", "10 back", "10 on", "a", "b", "run 1", "run 2", "run 3"]
"""Where else similarity to the token is looked for: another window, a pin, a run of Compare."""
Over = Literal["none", "not", "python", "row"]
"""What stands in the large map's place: what maps are not, the lines that give it, its row as text."""
Lines = Literal[
    "map", "heads", "tokens", "time", "entropy", "distance", "uniform", "TPA", "site", "sinks", "on sinks", "padding"
]
"""What the lines of Python give: what a card shows, or one of the numbers beside it."""
ONLY_PATTERN = r"(scale[0-3]|(encoder|decoder)\.\d{1,2}\.(self|cross))?"
Quantity = Literal["entropy", "mass", "effect"]


@dataclass(frozen=True, slots=True)
class PinnedMap:
    """A map that stays to be compared, with all that decides its numbers: its moment, its network, its query."""

    request: FrameRequest
    site: str
    head: int | None
    """`None`: gathered over heads."""
    gather: Gather
    direction: Direction
    query: tuple[int, int]


@dataclass(frozen=True, slots=True)
class AttentionState:
    """One visitor's look at attention. What is pinned does not outlive the visit."""

    view: ClassVar[str] = "attention"
    site: str = text("scale1.encoder.0.self", SITE_PATTERN)
    head: int | None = whole(None, 0, MOST_HEADS - 1)
    """`None` is all heads, gathered."""
    overlay: float = number(0.8, 0.0, 1.0)
    map_range: MapRange = "shared"
    gather: Gather = "mean"
    order: Order = "network"
    direction: Direction = "attends to"
    weight: Weight = "alpha"
    is_linear: bool = False
    is_smooth: bool = False
    shows_links: bool = False
    """Whether lines in the scene join the query to what it reads most."""
    shows_planes: bool = False
    """Whether the chosen layer's maps of all scales stand behind the frame, instead of the events."""
    keep: Keep = "all"
    tokens: Shelf = "similarity"
    feature: FeatureWord = "tokens"
    also: Also = "none"
    curve: Quantity = "entropy"
    follows: bool = False
    """Whether map and curves stay on the patch under the pixel, along the motion of its events."""
    anchor: int | None = passing(None)
    """The window in which the patch that is followed lies at the pixel."""
    compare: Literal["none", "a", "b"] = passing("none")
    """The pin that the current map is held against."""
    over: Over = "none"
    lines: Lines = "map"
    shows_dots: bool = False
    """Whether the atlas is a plot of all heads, entropy by distance, in place of maps."""
    only: str = text("", ONLY_PATTERN)
    """What the atlas is narrowed to: "scale2" or a column, "encoder.0.self"; its heads then stand there one by one."""
    sites: tuple[str, ...] = passing(())
    """Those of the chosen network, in its order; empty before they are known."""
    num_heads: int = passing(0)
    pin_a: PinnedMap | None = passing(None)
    pin_b: PinnedMap | None = passing(None)

    @property
    def quantity_has_a_head(self) -> bool:
        """Whether the curve is about the chosen head alone: an effect is, entropies are of every head."""
        return self.curve == "effect"

    def anchored(self, index: int) -> int | None:
        """The window from which the patch is followed on a page at window `index`; `None` where none is."""
        if not self.follows:
            return None
        return index if self.anchor is None else self.anchor

    @property
    def pinned(self) -> PinnedMap | None:
        """The pin that the current map is held against, if there is one."""
        return {"a": self.pin_a, "b": self.pin_b}.get(self.compare)


@dataclass(frozen=True, slots=True)
class OpenSite:
    """Show this attention site ("scale1.encoder.0.self") large, with its heads beside each other."""

    site: str


@dataclass(frozen=True, slots=True)
class OpenHead:
    """Show one head of a site large."""

    site: str
    head: int


@dataclass(frozen=True, slots=True)
class StepSite:
    """Show the site so many places on in the network's order, or back; after the last comes the first."""

    by: int


@dataclass(frozen=True, slots=True)
class StepHead:
    """Show the head so many places on, or back; after the last come all heads together."""

    by: int


@dataclass(frozen=True, slots=True)
class PinMap:
    """Keep the map that is shown as A or B, with its moment and network."""

    slot: Pin
    query: tuple[int, int] | None = None
    """Of which pixel the map is; `None`: of the chosen one. One that is followed lies elsewhere by now."""


@dataclass(frozen=True, slots=True)
class Unpin:
    """Forget a pin."""

    slot: Pin


@dataclass(frozen=True, slots=True)
class Compare:
    """Hold the current map against a pin, or against none."""

    slot: Literal["none", "a", "b"]


def reduce_attention(slice_: AttentionState, intent: Any, here: Here) -> AttentionState:
    """Pins hold their moment and their network; they are of one recording. A patch is followed from where it was."""
    return _anchored(_reduced(slice_, intent, here), intent, here)


def _anchored(slice_: AttentionState, intent: Any, here: Here) -> AttentionState:
    """The window at which the query was set, while it is followed; windows of another plan have other numbers."""
    anchor = slice_.anchor
    match intent:
        case _ if not slice_.follows:
            anchor = None
        case ask.OpenRecording() | ask.ReopenRecording() | ask.ChoosePolicy() | ask.ChooseCleaning() | ask.Settle():
            anchor = None
        case ask.Query() | ask.QueryFraction() | ask.MoveQuery() | ask.Set("attention", "follows"):
            anchor = here.state.index
        case _ if anchor is None and here.state.query is not None:
            anchor = here.state.index
    return slice_ if anchor == slice_.anchor else replace(slice_, anchor=anchor)


def _reduced(slice_: AttentionState, intent: Any, here: Here) -> AttentionState:
    match intent:
        case OpenSite():
            return _opened(slice_, intent.site)
        case OpenHead(site, head):
            return replace(_opened(slice_, site), head=head if 0 <= head < MOST_HEADS else None)
        case StepSite(by) if slice_.sites:
            at = slice_.sites.index(slice_.site) if slice_.site in slice_.sites else 0
            return replace(slice_, site=slice_.sites[(at + by) % len(slice_.sites)])
        case StepHead(by) if slice_.num_heads:
            is_one = slice_.head is not None and slice_.head < slice_.num_heads
            at = (slice_.head if is_one and slice_.head is not None else slice_.num_heads) + by
            at %= slice_.num_heads + 1
            return replace(slice_, head=None if at == slice_.num_heads else at)
        case ask.NetworkKnown(sites, num_heads):
            return replace(slice_, sites=sites, num_heads=num_heads)
        case ask.ChooseModel(model_id) if model_id != here.state.model_id:
            return replace(slice_, sites=(), num_heads=0)
        case PinMap(slot, query):
            pinned = _pinned(slice_, here, query)
            held = {"pin_a": pinned} if slot == "a" else {"pin_b": pinned}
            return slice_ if pinned is None else replace(slice_, compare=slot, **held)
        case Unpin(slot):
            compare = "none" if slice_.compare == slot else slice_.compare
            also = "none" if slice_.also == slot else slice_.also
            gone = {"pin_a": None} if slot == "a" else {"pin_b": None}
            return replace(slice_, compare=compare, also=also, **gone)
        case Compare(slot):
            return replace(slice_, compare=slot)
        case ask.OpenRecording() | ask.ReopenRecording():
            return replace(slice_, pin_a=None, pin_b=None, compare="none", also="none")
    return slice_


def _opened(slice_: AttentionState, site: str) -> AttentionState:
    try:
        return replace(slice_, site=checked(AttentionState, "site", site))
    except ValueError:
        return slice_


def _pinned(slice_: AttentionState, here: Here, query: tuple[int, int] | None) -> PinnedMap | None:
    """The map that is shown; `None` before there is one."""
    state = here.state
    if state.query is None or state.policy is None:
        return None
    request = FrameRequest(
        state.recording_id, state.model_id, state.precision, state.policy, state.index, cleaning=state.cleaning
    )
    request = changed_request(state.of(InspectState), request)
    return PinnedMap(request, slice_.site, slice_.head, slice_.gather, slice_.direction, query or state.query)


def other_moment(state: ViewState, request: FrameRequest) -> FrameRequest | None:
    """Where else similarity to the token is looked for, as a request; `None` where that is nowhere."""
    slice_ = state.of(AttentionState)
    kind, _, number = slice_.also.partition(" ")
    if slice_.also in ("10 back", "10 on"):
        index = request.index + (10 if slice_.also == "10 on" else -10)
        return changed_request(state.of(InspectState), replace(request.plain, index=max(index, 0)))
    if kind == "run":
        runs = dict(comparable_runs(state))
        run = runs.get(int(number))
        if run is None:
            return None
        return replace(
            request.plain, model_id=run.model_id or request.model_id, precision=run.precision or request.precision
        )
    pinned = {"a": slice_.pin_a, "b": slice_.pin_b}.get(kind)
    return None if pinned is None else pinned.request


def comparable_runs(state: ViewState) -> tuple[tuple[int, Run], ...]:
    """Runs of Compare with the main run's windows and events, by their place: another network or precision."""
    runs = enumerate(state.of(CompareState).runs, start=1)
    return tuple(
        (place, run)
        for place, run in runs
        if run.policy is None and run.cleaning is None and run.cold_from is None and run.replays is None
    )


def hear(words: str) -> Any:
    """What a click on one of the view's own buttons says; `None` for what none of them sends."""
    verb, _, rest = words.partition(":")
    match verb:
        case "site":
            return StepSite(int(rest)) if rest in ("+1", "-1") else OpenSite(rest)
        case "head":
            site, _, head = rest.partition(":")
            return OpenHead(site, int(head)) if head.isdecimal() and len(head) < 3 else None
        case "pin":
            return _pin_heard(rest)
        case "unpin" if rest in get_args(Pin):
            return Unpin(cast("Pin", rest))
        case "compare" if rest in ("none", *get_args(Pin)):
            return Compare(cast("Literal['none']", rest))
    return None


def _pin_heard(words: str) -> PinMap | None:
    """ "a", or "a:20,9" of a pixel that is not the chosen one."""
    slot, *pixel = words.split(":")
    x, _, y = pixel[0].partition(",") if len(pixel) == 1 else ("", "", "")
    is_pixel = x.isdecimal() and y.isdecimal() and len(x) < 6 and len(y) < 6
    if slot not in get_args(Pin) or (pixel and not is_pixel):
        return None
    return PinMap(cast("Pin", slot), (int(x), int(y)) if is_pixel else None)


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
        slice_.direction,
        slice_.is_linear,
        slice_.is_smooth,
        slice_.keep,
    )


def look_of(page: Page) -> AttentionLook | None:
    """How a visitor looks at the attention of the page's network."""
    return look_in(page.state, page.model.is_linear_light)


def path_of(page: Page, ready: Ready) -> Path:
    """Where the followed patch lies in the windows around the current one, as far as it is known of a frame's plan."""
    result, anchor = page.results.get("attention.path"), page.state.of(AttentionState).anchored(page.state.index)
    job: Any = None if result is None else result.job
    if result is None or result.value is None or job.request.playback != ready.request.playback:
        return {}
    return result.value if (job.pixel, job.anchor) == (page.state.query, anchor) else {}


def followed_place(page: Page) -> tuple[int, int] | None:
    """Where the followed patch lies in the current window; `None` where none is followed, or it is not known."""
    return None if page.ready is None else path_of(page, page.ready).get(page.state.index)
