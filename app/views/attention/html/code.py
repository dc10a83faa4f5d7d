"""Copy as Python, and a row as text: what stands in the large map's place while it is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.html.attention.python import Named, described, python_of
from app.html.card import icon_button, segmented
from app.html.elements import escape
from app.views.attention.html.pins import difference_of
from app.views.attention.html.shown import Shown
from app.views.attention.jobs.site import feature_of_word
from app.views.attention.state import other_moment

if TYPE_CHECKING:
    from app.engine.requests import FrameRequest
    from etnet.inspection.asked import Asked

LINES = {"map": "map", "heads": "heads", "tokens": "tokens", "time": "over time"}


def code_block(shown: Shown) -> str:
    """The lines that give what a card shows, to be copied."""
    slice_ = shown.slice_
    options = {f"set:attention.lines:{name}": words for name, words in LINES.items()}
    choice = segmented("Lines for", options, f"set:attention.lines:{slice_.lines}")
    return _block(
        "python", "Copy as Python", choice, snippet(shown), "Exact on the same machine, with the same versions."
    )


def row_block(shown: Shown) -> str:
    """The large map's row as text, one line a token, to be copied or saved."""
    save = f'<button class="et-button" data-etv-save-text="{escape(file_name(shown))}">Save as CSV</button>'
    note = "‖αvW_O‖ as shares." if shown.uses_values else ""
    return _block("row", "Row of the map", save, row_text(shown), note)


def row_text(shown: Shown) -> str:
    """The map as the library writes it: place, weight in full, × uniform."""
    import torch

    from etnet.inspection.threshold import row_csv

    return row_csv(torch.from_numpy(shown.row().copy()), shown.grid)


def file_name(shown: Shown) -> str:
    """Where the row is saved: site, head, token, window."""
    head = shown.look.gather if shown.look.head is None else f"head{shown.look.head}"
    way = "" if shown.look.direction == "attends to" else "_received"
    return f"{shown.site}_{head}{way}_token{shown.token}_window{shown.ready.request.index}.csv"


def _block(name: str, title: str, tools: str, text: str, note: str) -> str:
    close = icon_button("set:attention.over:none", "close", "Back to the map")
    copy = '<button class="et-button et-strong" data-etv-copy-text="1">Copy</button>'
    said = f'<span class="et-note">{escape(note)}</span>' if note else ""
    return (
        f'<div class="et-over-map" data-testid="over-{name}"><div class="et-map-line"><h4>{title}</h4>{close}</div>'
        f'<div class="et-chips">{tools}{copy}{said}</div>'
        f'<pre class="et-code" data-testid="{name}" tabindex="0">{escape(text)}</pre></div>'
    )


def snippet(shown: Shown) -> str:
    """The lines for the chosen card; of a map that is held against a pin, the difference."""
    from etnet.inspection.asked import Asked

    page, slice_, look = shown.page, shown.slice_, shown.look
    assert page.moment is not None
    named = _named(shown, shown.ready.request)
    now = described(page.moment, shown.ready, named)
    match slice_.lines:
        case "heads":
            return python_of(described(page.moment, shown.ready, named, shown.ready.request.plain), _heads(shown))
        case "tokens":
            feature = feature_of_word(slice_.feature, shown.site)
            if slice_.tokens == "pca":
                return python_of(now, Asked("colours", feature=feature))
            there = other_moment(page.state, shown.ready.request)
            if there is None:
                return python_of(now, Asked("similarity", feature=feature, pixel=look.query))
            other = described(page.moment, shown.ready, _named(shown, there), there)
            return python_of(other, Asked("similarity", feature=feature, pixel=look.query), now)
        case "time":
            return python_of(described(page.moment, shown.ready, named, shown.ready.request.plain), _time(shown))
    head = look.gather if look.head is None else look.head
    apart = difference_of(shown)
    if apart is not None:
        held = apart.pinned
        then = described(page.moment, shown.ready, _named(shown, held.request), held.request)
        asked = Asked("map_difference", shown.site, pixel=look.query, head=head, direction=look.direction)
        return python_of(now, asked, then)
    if shown.uses_values:
        return python_of(now, Asked("value_weighted", shown.site, shown.token, head=head))
    return python_of(now, Asked("map", shown.site, shown.token, head=head, direction=look.direction))


def _named(shown: Shown, request: FrameRequest) -> Named:
    """Names of a request's recording and network; that of another network than the page's is its id."""
    page = shown.page
    is_other = request.model_id != shown.ready.request.model_id
    return Named(page.file_name or "recording", request.model_id if is_other else page.model.source)


def _heads(shown: Shown) -> Asked:
    from etnet.inspection.asked import Asked

    return Asked("atlas", pixel=shown.look.query)


def _time(shown: Shown) -> Asked:
    from app.views.attention.jobs.time import NEAR
    from etnet.inspection.asked import Asked

    slice_, result = shown.slice_, shown.page.results.get("attention.curve")
    index = shown.ready.request.index
    indices = (index,) if result is None or result.value is None else result.value.indices
    x, y = shown.look.query
    until = indices[-1] if slice_.follows else None
    if slice_.curve == "effect":
        return Asked(
            "masked", shown.site, pixel=(x, y), head=shown.look.head, windows=(indices[0], indices[-1]), until=until
        )
    quantity = "entropy" if slice_.curve == "entropy" else "mass"
    near = NEAR if quantity == "mass" else None
    return Asked(
        "track", shown.site, pixel=shown.look.query, windows=(indices[0], indices[-1]), quantity=quantity, near=near,
        until=until,
    )  # fmt: skip
