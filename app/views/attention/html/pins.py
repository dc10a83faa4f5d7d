"""Pins: a map at another moment, of another head or network, and the current map held against it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from app.html.attention.changed import site_name
from app.html.attention.maps import gathered, head_words
from app.html.units import count
from app.views.attention.html.shown import Shown
from app.views.attention.jobs.time import FoundPin, PinJob
from app.views.attention.state import PinnedMap
from app.views.naming import title_of
from app.views.page import Page

if TYPE_CHECKING:
    from etnet.inspection.pins import MapDifference, Pin
    from etnet.nets.runtime import Contract


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """The current map against a pin."""

    slot: Literal["a", "b"]
    pinned: PinnedMap
    found: MapDifference
    contract: Contract
    """Under which the pin's map was computed."""


def pin_words(page: Page, pinned: PinnedMap) -> str:
    """What a pin holds: moment, network, site, head, query."""
    x, y = pinned.query
    head = head_words(pinned.head, pinned.gather)
    model = title_of(page, pinned.request.model_id)
    whose = "what pixel {} attends to" if pinned.direction == "attends to" else "what attends to pixel {}"
    return f"window {count(pinned.request.index)} · {model} · {site_name(pinned.site)}, {head} · " + whose.format(
        f"{x}, {y}"
    )


def difference_of(shown: Shown) -> Difference | None:
    """`None` where nothing is compared, the pin is not computed yet, or the two grids differ."""
    slice_ = shown.slice_
    found = shown.page.results.get("attention.pin")
    if slice_.pinned is None or found is None or found.value is None or found.job != PinJob(slice_.pinned):
        return None
    held: FoundPin = found.value
    if held.pin.grid != shown.grid:
        return None
    from etnet.inspection.pins import difference

    slot: Literal["a", "b"] = "a" if slice_.compare == "a" else "b"
    return Difference(slot, slice_.pinned, difference(now_of(shown), held.pin), held.contract)


def pin_trouble(shown: Shown) -> str:
    """Why the pin that the current map is held against cannot be computed; empty where it can, or none is."""
    pinned, found = shown.slice_.pinned, shown.page.results.get("attention.pin")
    return found.trouble if pinned is not None and found is not None and found.job == PinJob(pinned) else ""


def now_of(shown: Shown) -> Pin:
    """The current map as a pin: its weights, because a pin holds weights, whatever else is shown of rows."""
    import torch

    from etnet.inspection.pins import Pin

    moment, ready, look = shown.page.moment, shown.ready, shown.look
    assert moment is not None
    index = ready.request.index
    return Pin(
        moment.recording.name,
        shown.page.model.title,
        index,
        moment.windows[index].t_stop,
        look.query,
        shown.site,
        look.gather if look.head is None else look.head,
        look.direction,
        torch.from_numpy(gathered(shown.weights(), look.head, look.gather).copy()),
        torch.from_numpy(ready.frame.copy()),
        shown.grid,
    )
