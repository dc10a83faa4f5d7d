"""Copy as Python, and a row as text: what stands in the large map's place while it is asked for."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from app.html.attention.python import described, python_of
from app.html.elements import escape, icon_button, select
from app.views.attention.html.pins import difference_of
from app.views.attention.html.shown import Shown
from app.views.attention.html.tokens import found_elsewhere
from app.views.attention.jobs.site import feature_of_word
from app.views.attention.state import Lines
from app.views.naming import cannot_be_named, named
from app.views.stretch import NEAR
from etnet.nets.intervention import Intervention

if TYPE_CHECKING:
    from app.engine.requests import FrameRequest
    from etnet.inspection.described import Described
    from etnet.nets.runtime import Contract

LINES: dict[Lines, str] = {
    "map": "the large map",
    "heads": "effects of all heads",
    "entropy": "entropy of all heads",
    "distance": "distance of all heads",
    "tokens": "tokens",
    "time": "over time",
    "uniform": "all attention uniform",
    "TPA": "no TPA",
    "site": "this site ablated",
    "sinks": "sinks of this site",
    "on sinks": "of this row on sinks",
    "padding": "of this row on padding",
}
"""What lines can be had for: what the cards show, and the numbers beside them."""


def code_block(shown: Shown) -> str:
    """The lines that give what a card shows, to be copied; or why there are none."""
    refused = cannot_be_named(shown.page)
    if refused:
        close = icon_button("set:attention.over:none", "close", "Back to the map")
        title = f'<div class="et-map-line"><h4>Copy as Python</h4>{close}</div>'
        said = f'<div class="et-say" data-testid="no-lines">{escape(refused)}</div>'
        return f'<div class="et-over-map" data-testid="over-python">{title}{said}</div>'
    choice = select("Lines for", "set:attention.lines", {str(name): said for name, said in LINES.items()},
                    shown.slice_.lines)  # fmt: skip
    note = "Exact on the same machine, with the same versions."
    return _block("python", "Copy as Python", choice, snippet(shown), note)


def row_block(shown: Shown) -> str:
    """The large map's row as text, one line a token, to be copied or saved."""
    save = f'<button class="et-button" data-etv-save-text="{escape(file_name(shown))}">Save as CSV</button>'
    apart = difference_of(shown)
    title = "Row of the map" if apart is None else f"Now and {apart.slot.upper()}, token by token"
    note = "‖αvW_O‖ as shares." if apart is None and shown.uses_values else ""
    return _block("row", title, save, row_text(shown), note)


def row_text(shown: Shown) -> str:
    """The map as the library writes it: place, weight in full, × uniform; of a difference both maps and their ratio."""
    import torch

    from etnet.inspection.pins import difference_csv
    from etnet.inspection.threshold import row_csv

    apart = difference_of(shown)
    if apart is not None:
        return difference_csv(apart.found)
    return row_csv(torch.from_numpy(shown.row().copy()), shown.grid)


def file_name(shown: Shown) -> str:
    """Where the row is saved: site, head, token, window; of a difference the pin's window, too."""
    head = shown.look.gather if shown.look.head is None else f"head{shown.look.head}"
    way = "" if shown.look.direction == "attends to" else "_received"
    apart = difference_of(shown)
    then = "" if apart is None else f"_minus_window{apart.pinned.request.index}"
    return f"{shown.site}_{head}{way}_token{shown.token}_window{shown.ready.request.index}{then}.csv"


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
    """The lines that were chosen; of a map that is held against a pin, the difference."""
    from etnet.inspection.asked import Asked

    now = _moment(shown, shown.ready.request, shown.ready.contract)
    original = _moment(shown, shown.ready.request.plain, shown.ready.contract)
    lines, site, token = shown.slice_.lines, shown.site, shown.token
    match lines:
        case "map":
            return _of_map(shown, now)
        case "tokens":
            return _of_tokens(shown, now)
        case "heads":
            return python_of(original, Asked("atlas", pixel=shown.look.query))
        case "time":
            return _of_time(shown)
        case "entropy" | "distance":
            return python_of(now, Asked("table", token=token, quantity=lines))
        case "uniform" | "TPA" | "site":
            cuts = {
                "uniform": Intervention(uniform_attention=True),
                "TPA": Intervention(without_context=True),
                "site": Intervention(removed_sites=frozenset({site})),
            }
            return python_of(original, Asked("without", cut=cuts[lines]))
        case "sinks" | "on sinks":
            return python_of(now, Asked("sinks", site, token if lines == "on sinks" else None))
    return python_of(now, Asked("padding", site, token))


def _moment(shown: Shown, request: FrameRequest, contract: Contract) -> Described:
    assert shown.page.moment is not None
    return described(shown.page.moment, request, contract, named(shown.page, request.model_id))


def _of_map(shown: Shown, now: Described) -> str:
    from etnet.inspection.asked import Asked, OneMap

    look = shown.look
    head = look.gather if look.head is None else look.head
    apart = difference_of(shown)
    if apart is not None:
        then = apart.found.then  # as it was computed: of another network, whose first site it may be
        held = OneMap(then.pixel, then.site, then.head, then.direction)
        asked = Asked("map_difference", shown.site, pixel=look.query, head=head, direction=look.direction, then=held)
        return python_of(now, asked, _moment(shown, apart.pinned.request, apart.contract))
    if shown.uses_values:
        return python_of(now, Asked("value_weighted", shown.site, shown.token, head=head))
    return python_of(now, Asked("map", shown.site, shown.token, head=head, direction=look.direction))


def _of_tokens(shown: Shown, now: Described) -> str:
    """Colours, or similarity here; where it is looked for elsewhere and known, similarity there."""
    from etnet.inspection.asked import Asked

    feature = feature_of_word(shown.slice_.feature, shown.site)
    if shown.slice_.tokens == "pca":
        return python_of(now, Asked("colours", feature=feature))
    elsewhere = found_elsewhere(shown)
    if elsewhere is None or elsewhere.value is None:
        return python_of(now, Asked("similarity", feature=feature, pixel=shown.look.query))
    there = elsewhere.value
    other = _moment(shown, elsewhere.job.request, there.contract)
    asked = Asked("similarity", feature=there.map.feature, pixel=shown.look.query, reference=feature)
    return python_of(other, asked, now)


def _of_time(shown: Shown) -> str:
    """The curve over the windows that are there by now; a patch is followed from the window where it was chosen."""
    from etnet.inspection.asked import Asked

    request, slice_ = shown.ready.request.plain, shown.slice_
    found, query = shown.found("curve"), shown.page.state.query
    indices = (request.index,) if found is None or found.value is None else found.value.indices
    anchor = slice_.anchored(shown.page.state.index)
    stretch, until = (indices[0], indices[-1]), None if anchor is None else indices[-1]
    moment = _moment(shown, request if anchor is None else replace(request, index=anchor), shown.ready.contract)
    if slice_.curve == "effect":
        return python_of(
            moment, Asked("masked", shown.site, pixel=query, head=shown.look.head, windows=stretch, until=until)
        )
    near = NEAR if slice_.curve == "mass" else None
    asked = Asked("track", shown.site, pixel=query, windows=stretch, quantity=slice_.curve, near=near, until=until)
    return python_of(moment, asked)
