"""What stands beside the maps of attention: how they are gathered, sorted and coloured, and two maps compared."""

from __future__ import annotations

import numpy as np

from app.engine.requests import Ready
from app.html.attention.look import Gather, Order
from app.html.attention.maps import (
    AttentionLook,
    base_url,
    gathered,
    head_words,
    map_facts,
    map_html,
    rows_of,
    site_words,
    tokens_words,
)
from app.html.controls import button, buttons
from app.html.elements import escape, legend, panel, picture
from app.html.units import of_whole, short
from app.views.attention.state import AttentionState, PinnedMap, pin_text
from app.views.inspect.state import is_switched
from etnet.nets.intervention import Intervention
from etnet.render.attention import times_uniform
from etnet.render.colours import css_gradient, diverge, diverging
from etnet.render.encode import data_url

_GATHER: dict[Gather, str] = {"mean": "mean", "max": "largest", "min": "smallest"}
_ORDER: dict[Order, str] = {"network": "as in the network", "entropy": "sharpest first", "distance": "farthest first"}


def attention_tools_html(
    slice_: AttentionState,
    intervention: Intervention,
    look: AttentionLook | None,
    *,
    site: str | None,
) -> str:
    """Buttons for the maps; `site` is the one that is opened, whose map can be pinned. Nothing before a pixel."""
    if look is None:
        return ""

    def choices(name: str, words: dict[object, str], held: object) -> str:
        return "".join(button(text, f"set:attention.{name}:{word}", is_on=word == held) for word, text in words.items())

    rows: list[str] = []
    if site is not None:
        pinned = pin_text(PinnedMap(site, look.head, look.gather, look.query))
        pins = button("Pin as A", f"attention:pin:a:{pinned}") + button("Pin as B", f"attention:pin:b:{pinned}")
        rows.append(buttons("This map", pins, "Pin two maps, of any sites, heads or pixels, to see A − B."))
        rows.append(buttons("Take away", _switches(intervention, site, look.head)))
        ways: dict[object, str] = {"reads": "what it reads", "read by": "who reads it"}
        rows.append(buttons("Direction", choices("direction", ways, slice_.direction)))
    rows.append(buttons("Over heads", choices("gather", {**_GATHER}, slice_.gather)))
    rows.append(buttons("Order", choices("order", {**_ORDER}, slice_.order)))
    scales: dict[object, str] = {False: "logarithmic", True: "linear"}
    grains: dict[object, str] = {False: "tokens", True: "smooth"}
    rows.append(
        buttons(
            "Drawn", choices("is_linear", scales, slice_.is_linear) + choices("is_smooth", grains, slice_.is_smooth)
        )
    )
    links: dict[object, str] = {False: "no links", True: "the strongest links"}
    rows.append(buttons("In the scene", choices("shows_links", links, slice_.shows_links)))
    planes: dict[object, str] = {False: "events behind", True: "this layer's maps behind"}
    rows.append(
        buttons("", choices("shows_planes", planes, slice_.shows_planes), "Maps behind: not in the front view.")
    )
    return panel("attention-tools", *rows)


def _switches(intervention: Intervention, site: str, head: int | None) -> str:
    """Take this head or this attention out of the network."""
    parts = {f"site {site}": "this attention"}
    if head is not None:
        parts = {f"head {site} {head}": f"head {head + 1}", **parts}
    return "".join(
        button(
            words, f"inspect:switch:{part}", is_on=is_switched(intervention, part), hint="See Inside: Change something"
        )
        for part, words in parts.items()
    )


def pinned_html(ready: Ready | None, look: AttentionLook | None, slice_: AttentionState) -> str:
    """The pinned maps of the current window and their difference; nothing while none is pinned."""
    pins = {slot: pin for slot, pin in (("a", slice_.pin_a), ("b", slice_.pin_b)) if pin is not None}
    attention = ready.attention if ready is not None else None
    if not pins or look is None or ready is None or attention is None:
        return ""
    pins = {slot: pin for slot, pin in pins.items() if pin.site in attention.sites}
    rows = {
        slot: gathered(rows_of(ready, attention, pin.site, pin.query), pin.head, pin.gather)
        for slot, pin in pins.items()
    }
    cells = []
    for slot, pin in pins.items():
        own = AttentionLook(pin.query, None, look.opacity, look.map_range, look.tones, is_linear=look.is_linear)
        map_ = map_html(attention, rows[slot], own, f"pinned map {slot.upper()}", "")
        bits, pixels = map_facts(attention, rows[slot], pin.query)
        words = site_words(pin.site, attention.sites).split(",")[0]
        facts = f"≈ {tokens_words(rows[slot])} tokens · {bits:.1f} bits · {pixels:.0f} px"
        let_go = button("Unpin", f"attention:unpin:{slot}")
        label = (
            f"<b>{slot.upper()}</b> {escape(words)}<br>{head_words(pin.head, pin.gather)}<br>"
            f"from ({pin.query[0]}, {pin.query[1]}) · {facts}"
        )
        cells.append(
            f'<figure class="et-thumb">{map_}<figcaption class="et-label">{label}</figcaption>{let_go}</figure>'
        )
    body = f'<div class="et-pair">{"".join(cells)}</div>'
    if len(rows) == 2:
        body += _difference(ready, rows["a"], rows["b"])
    style = f"--n:{attention.grid.columns};--base:url({base_url(ready, attention, look.tones)})"
    return panel("pinned", "<h4>Pinned maps, in this window</h4>", body, style=style)


def _difference(ready: Ready, first: np.ndarray, second: np.ndarray) -> str:
    assert ready.attention is not None
    grid = ready.attention.grid
    apart = times_uniform(first) - times_uniform(second)
    limit = max(float(np.abs(apart).max()), 1e-6)
    image = picture(
        data_url(diverge(apart.reshape(grid.rows, grid.columns), limit), is_lossless=True),
        "A − B",
        size=(grid.columns, grid.rows),
        classes="et-map et-wide",
    )
    shared = float(np.minimum(first, second).sum())
    ticks = [(0.0, f"B more: {short(limit)}"), (0.5, "alike"), (1.0, f"A more: {short(limit)}")]
    said = f'<div class="et-note" data-testid="a-minus-b">A and B share {of_whole(shared)} of their weight.</div>'
    return f"{image}{legend('A − B, × uniform', css_gradient(diverging()), ticks)}{said}"
