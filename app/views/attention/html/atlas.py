"""All sites at a glance: a map for each, and under it what each head does to the pixel when it is masked."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.html.attention.changed import changed_at
from app.html.attention.look import Order
from app.html.attention.maps import (
    Site,
    base_url,
    map_facts,
    map_html,
    row_of,
    rows_of,
    site_words,
    tokens_words,
)
from app.html.controls import button, percent
from app.html.elements import ON_PICK, escape, icon_button, panel, select
from app.html.moment import PICTURES
from app.html.units import resolution
from app.views.attention.html.dots import dots_html
from app.views.attention.html.shown import Shown, missing, not_button, shown_of
from app.views.attention.state import AttentionState
from app.views.page import Page
from etnet.render.attention import times_uniform

_ALIKE = 2.0
"""× uniform that no token reaches in a row which attends to all of them almost alike."""
_ALIKE_WORDS = "Every site attends to all tokens almost alike here: its attention tells little."
LOUD = 0.25
"""Of the strongest head's effect: from there on a bar is drawn in the accent."""
_ORDERS: dict[Order, str] = {
    "network": "in network order",
    "effect": "by effect on pixel",
    "image": "by effect on image",
    "entropy": "by entropy",
    "distance": "by distance",
}


def atlas_html(page: Page) -> tuple[str, str, str]:
    """Note, tools and body of the card."""
    shown = shown_of(page)
    slice_ = page.state.of(AttentionState)
    tools = _tools(slice_)
    if shown is None:
        return "", tools, panel("attention", missing(page, is_brief=True))
    effects = measured_of(shown)
    where = "on the image" if shown.look.order == "image" else "on this pixel"
    note = _bars_note(effects, where)
    style = f"--base:url({base_url(shown.ready, shown.attention, shown.look.tones)})"
    if slice_.shows_dots:
        note, body = "size: effect on this pixel when masked; ring: on the image", dots_html(shown, effects_of(shown))
    elif only := narrowed(shown):
        note, body = f"effect {where} when masked", _heads_grid(shown, effects, only)
    else:
        body = _grid(shown, effects)
    return _progress(shown) + note, tools, panel("attention", body, _alike(shown), style=style)


def _bars_note(effects: dict[str, np.ndarray], where: str) -> str:
    """What the bars say, and how much the tallest is; whole under the pointer, because the header is narrow."""
    most = _largest(effects)
    tallest = f", tallest {percent(most, is_signed=False)}" if most > 0 else ""
    whole = f"bars: effect of each head {where} when masked{tallest}"
    return f'<span title="{whole}">bars: effect {where}{tallest}</span>'


def _largest(effects: dict[str, np.ndarray]) -> float:
    return max((float(np.nanmax(np.abs(row))) for row in effects.values() if not np.isnan(row).all()), default=0.0)


def _tools(slice_: AttentionState) -> str:
    """The order of maps, or the plot; and back from a part of the atlas to all of it."""
    words = {str(name): said for name, said in _ORDERS.items()}
    narrow = button("all sites", "set:attention.only:") if slice_.only and not slice_.shows_dots else ""
    dots = icon_button(
        f"set:attention.shows_dots:{not slice_.shows_dots}",
        "dots",
        "All heads as dots: entropy by distance",
        is_on=slice_.shows_dots,
    )
    order = "" if slice_.shows_dots else select("Order", "set:attention.order", words, slice_.order)
    return narrow + order + dots + not_button(slice_)


def narrowed(shown: Shown) -> tuple[str, ...]:
    """The sites of the chosen scale, or of the chosen column; none where all are shown."""
    only = shown.slice_.only
    wanted = [name for name in shown.attention.sites if only in name.split(".", 1)]
    return tuple(wanted) if only else ()


def _heads_grid(shown: Shown, effects: dict[str, np.ndarray], sites: tuple[str, ...]) -> str:
    """Each head of some sites by itself: a column for each site, a row for each head; or in an order of their own."""
    style = f"--columns:{len(sites)};--rows:{shown.num_heads}"
    heads = range(shown.num_heads)
    if shown.look.order != "network":
        both = sorted(((name, head) for head in heads for name in sites), key=lambda one: _rank(shown, effects, *one))
        drawn = "".join(
            _head_cell(shown, effects, name, head, f"{_own_part(shown, name)} · {head}") for name, head in both
        )
        return f'<div class="et-sites et-atlas et-sorted et-by-head" style="{style}">{drawn}</div>'
    named = (f'<div class="et-head">{_short(name).rpartition(" ")[0]}<br>{Site.of(name).kind}</div>' for name in sites)
    cells = ["<div class=et-head>head</div>", *named]
    for head in heads:
        cells.append(f'<div class="et-name"><b>{head}</b></div>')
        cells += [_head_cell(shown, effects, name, head) for name in sites]
    return f'<div class="et-sites et-atlas et-by-head" style="{style}">{"".join(cells)}</div>'


def _own_part(shown: Shown, name: str) -> str:
    """What tells a site from the others of the part: its layer within a scale, its scale within a layer."""
    scale, _, layer = _short(name).partition(" ")
    return layer if shown.slice_.only.startswith("scale") else scale


def _head_cell(shown: Shown, effects: dict[str, np.ndarray], name: str, head: int, which: str = "") -> str:
    look = shown.look
    row = rows_of(shown.ready, shown.attention, name, look.query, look.direction)[head]
    map_ = map_html(shown.attention, row, look, f"{name}, head {head}", f"attention:head:{name}:{head}")
    mark = " et-chosen" if (name, head) == (shown.site, look.head) else ""
    if (name, head) in shown.ready.request.intervention.masked_heads:
        mark += " et-muted"
    value = effects.get(name)
    said = "…" if value is None or np.isnan(value[head]) else effect_words(float(value[head]))
    label = f"{which}<br>{said}" if which else said
    return f'<div class="et-thumb{mark}">{map_}<span class="et-label">{label}</span></div>'


def _rank(shown: Shown, effects: dict[str, np.ndarray], name: str, head: int) -> float:
    """Of one head in the chosen order; those that are not measured come last."""
    if shown.look.order in ("effect", "image"):
        value = effects.get(name)
        return 1.0 if value is None or np.isnan(value[head]) else -abs(float(value[head]))
    row = rows_of(shown.ready, shown.attention, name, shown.look.query, shown.look.direction)[head]
    bits, pixels = map_facts(shown.attention, row, shown.look.query)
    return bits if shown.look.order == "entropy" else -pixels


def measured_of(shown: Shown) -> dict[str, Float[np.ndarray, " heads"]]:
    """What bars and numbers stand for: the effect on the pixel, or, in the order of that, on the image."""
    atlas = shown.result("atlas")
    if shown.look.order != "image" or atlas is None:
        return effects_of(shown)
    return dict(zip(atlas.sites, atlas.on_image.numpy(), strict=True))


def effects_of(shown: Shown) -> dict[str, Float[np.ndarray, " heads"]]:
    """By site: masked − not masked at the pixel, of the original network; NaN where it is not measured yet."""
    atlas = shown.result("atlas")
    if atlas is None:
        return {}
    table = atlas.on_pixel(*shown.look.query).numpy()
    return dict(zip(atlas.sites, table, strict=True))


def _progress(shown: Shown) -> str:
    atlas = shown.result("atlas")
    if atlas is None:
        found = shown.found("atlas")
        return f"{escape(found.trouble)} · " if found is not None and found.trouble else "waiting · "
    done, wanted = atlas.progress
    return "" if atlas.is_whole else f'<span data-testid="atlas-progress">{done} of {wanted}</span> · '


def _grid(shown: Shown, effects: dict[str, np.ndarray]) -> str:
    """A row for each scale, the coarsest first, a column for each layer; or the sites in an order of their own."""
    sites = {name: Site.of(name) for name in shown.attention.sites}
    layers = list(dict.fromkeys(site.row for site in sites.values()))
    scales = sorted({site.scale for site in sites.values()}, reverse=True)
    largest = _largest(effects)
    style = f"--columns:{len(layers)};--rows:{len(scales)}"
    if shown.look.order != "network":
        cells = [_cell(shown, name, effects, largest, _place(name)) for name in _sorted(shown, effects)]
        return f'<div class="et-sites et-atlas et-sorted" style="{style}">{"".join(cells)}</div>'
    by_place = {(site.row, site.scale): name for name, site in sites.items()}
    short_names = {"encoder": "enc", "decoder": "dec"}
    cells = ["<span></span>"]
    cells += [
        f'<button class="et-head et-narrow" data-k="set:attention.only:{part}.{layer}.{kind}" {ON_PICK}'
        f' title="Its heads, one by one">{short_names.get(part, part)} {layer}<br>{kind}</button>'
        for part, layer, kind in layers
    ]
    for scale in scales:
        cells.append(
            f'<button class="et-name et-narrow" data-k="set:attention.only:scale{scale}" {ON_PICK}'
            f' title="Its heads, one by one"><b>{resolution(scale)}</b></button>'
        )
        cells += [
            "<span></span>" if (name := by_place.get((layer, scale))) is None else _cell(shown, name, effects, largest)
            for layer in layers
        ]
    return f'<div class="et-sites et-atlas" style="{style}">{"".join(cells)}</div>'


def _place(name: str) -> str:
    return f'<span class="et-label">{_short(name)}</span>'


def _short(name: str) -> str:
    site = Site.of(name)
    return f"{resolution(site.scale)} {site.part[:3]} {site.layer} {site.kind}"


def _cell(shown: Shown, name: str, effects: dict[str, np.ndarray], largest: float, label: str = "") -> str:
    look = shown.look

    def make() -> str:
        row = row_of(shown.ready, shown.attention, name, look)
        title = f"{site_words(name, shown.attention.sites)}; ≈ {tokens_words(row)} tokens"
        return map_html(shown.attention, row, look, title, f"attention:site:{name}")

    map_ = PICTURES.text(("atlas map", shown.ready.key, look, name), make)
    mark = " et-chosen" if name == shown.site else ""
    if changed_at(shown.ready.request.intervention, name):
        mark += " et-muted"
    return (
        f'<div class="et-thumb{mark}" data-testid="{escape(name)}" data-etv-site="{escape(name)}">{map_}'
        f"{bars(effects.get(name), largest, shown.num_heads)}{label}</div>"
    )


def bars(effects: Float[np.ndarray, " heads"] | None, largest: float, num_heads: int) -> str:
    """A bar for each head, as long as its effect is beside the strongest head's of all sites."""
    drawn: list[str] = []
    said: list[str] = []
    for head in range(num_heads):
        value = float("nan") if effects is None else float(effects[head])
        if np.isnan(value):
            drawn.append('<i class="et-unknown"></i>')
            continue
        share = abs(value) / largest if largest > 0 else 0.0
        loud = ' class="et-loud"' if share >= LOUD else ""
        drawn.append(f'<i{loud} style="height:{max(100 * share, 4):.0f}%"></i>')
        said.append(f"head {head}: {effect_words(value)}")
    title = "; ".join(said) or "not measured yet"
    return f'<span class="et-effects" title="{escape(title)}">{"".join(drawn)}</span>'


def effect_words(value: float) -> str:
    """A signed difference of a raw frame, of full brightness."""
    return percent(value)


def _sorted(shown: Shown, effects: dict[str, np.ndarray]) -> list[str]:
    """Sites by their strongest head's effect, by how sharp their map is, or by how far it reaches."""

    def place(name: str) -> float:
        if shown.look.order in ("effect", "image"):
            row = effects.get(name)
            return -float(np.nanmax(np.abs(row))) if row is not None and not np.isnan(row).all() else 0.0
        row = row_of(shown.ready, shown.attention, name, shown.look)
        bits, pixels = map_facts(shown.attention, row, shown.look.query)
        return bits if shown.look.order == "entropy" else -pixels

    return sorted(shown.attention.sites, key=place)


def _alike(shown: Shown) -> str:
    """What may be concluded of the whole: that maps are flat, or that making all of them flat changes nothing."""
    atlas = shown.result("atlas")
    if atlas is not None:
        x, y = shown.look.query
        here, image = abs(float(atlas.uniform[y, x])), float(atlas.uniform.abs().mean())
        if max(here, image) < 0.005:
            return (
                '<div class="et-note" data-testid="alike">With all attention made uniform this pixel moves by '
                f"{percent(here, is_signed=False)} and the image by {percent(image, is_signed=False)}: maps explain "
                "little here.</div>"
            )
    rows = (row_of(shown.ready, shown.attention, name, shown.look) for name in shown.attention.sites)
    if all(times_uniform(row).max() < _ALIKE for row in rows):
        return f'<div class="et-note" data-testid="alike">{_ALIKE_WORDS}</div>'
    return ""
