"""Where the network looks from one pixel: the atlas of all sites, or one site with its heads.

A click on a map of the atlas chooses that site, one on a head that head, one on the large map a pixel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.engine.requests import Failed, Ready, Working
from app.html.attention.maps import (
    AttentionLook,
    Site,
    base_url,
    gathered,
    head_words,
    map_facts,
    map_html,
    map_legend,
    over_frame,
    row_of,
    rows_of,
    site_words,
    source,
    tokens_words,
)
from app.html.elements import ON_PICK, empty, escape, marker, panel, picture
from app.html.moment import PICTURES
from app.html.pictures import lag_line
from app.html.units import count, resolution
from etnet.render.attention import times_uniform
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.nets.attention import Attention

_ALIKE = 2.0
"""× uniform that no token reaches in a row which reads all of them almost alike."""
_ALIKE_WORDS = "This network reads every place almost alike here: its attention tells little."


_ALL = f'<button class="et-button" data-k="set:attention.head:none" {ON_PICK}>All heads</button>'
_MEAN = f'<div class="et-chips">{_ALL}</div>'


def attention_html(
    ready: Ready | None,
    look: AttentionLook | None,
    *,
    chosen: str = "",
    wanted: int | None = None,
    working: Working | None = None,
    failed: Failed | None = None,
) -> str:
    """The grid of all sites. Says what is missing when there is nothing to show."""
    lag = lag_line(ready, wanted, working, failed)
    missing = _missing(ready, look)
    if missing or ready is None or look is None or ready.attention is None:
        return panel("attention", missing, lag)
    attention = ready.attention
    body = PICTURES.text(("attention", ready.key, look, chosen), lambda: _sites(ready, attention, look, chosen))
    return panel("attention", lag, body, style=_variables(ready, attention, look))


def site_html(
    ready: Ready | None,
    look: AttentionLook | None,
    site: str,
    *,
    wanted: int | None = None,
    working: Working | None = None,
    failed: Failed | None = None,
) -> tuple[str, str]:
    """The title and the content of the chosen site's card: its map large, what it amounts to, its heads."""
    lag = lag_line(ready, wanted, working, failed)
    missing = _missing(ready, look)
    if missing or ready is None or look is None or ready.attention is None:
        return "Attention", panel("site", missing, lag)
    attention = ready.attention
    if site not in attention.sites:
        said = f"{site} is not a site of this network. Choose one of its maps."
        return "Attention", panel("site", empty("No such site", said), lag)
    body = PICTURES.text(("site", ready.key, look, site), lambda: _heads(ready, attention, look, site))
    title = site_words(site, attention.sites)
    return title, panel("site", lag, body, style=_variables(ready, attention, look))


def _missing(ready: Ready | None, look: AttentionLook | None) -> str:
    """Why there are no maps; empty where there are."""
    if look is None:
        explanation = "Click into the reconstruction: every map then shows what the network reads to redraw that spot."
        return empty("Choose a pixel", explanation)
    if ready is None or ready.attention is None:
        return empty("No attention for this window yet", "It is computed together with the next image of this window.")
    if not ready.attention.sites:
        return empty("This network has no attention", "There are no maps to show. Choose another network.")
    return ""


def _variables(ready: Ready, attention: Attention, look: AttentionLook) -> str:
    return f"--n:{attention.grid.columns};--base:url({base_url(ready, attention, look.tones)})"


def _sites(ready: Ready, attention: Attention, look: AttentionLook, chosen: str) -> str:
    """The atlas: a row for each scale, the coarsest first, a column for each layer."""
    sites = {name: Site.of(name) for name in attention.sites}
    scales = sorted({site.scale for site in sites.values()}, reverse=True)
    layers = list(dict.fromkeys(site.row for site in sites.values()))
    by_place = {(site.row, site.scale): name for name, site in sites.items()}
    short = {"encoder": "enc", "decoder": "dec"}
    cells = ["<span></span>"]
    cells += [
        f'<div class="et-head">{short.get(part, part)} {layer + 1}<br>{kind}</div>' for part, layer, kind in layers
    ]
    for scale in scales:
        cells.append(f'<div class="et-name"><b>{resolution(scale)}</b></div>')
        cells += [_site_cell(ready, attention, look, by_place.get((layer, scale)), chosen) for layer in layers]
    where = f"What pixel ({look.query[0]}, {look.query[1]}) attends to"
    who = head_words(look.head, look.gather)
    of = f"of {count(attention.grid.num_tokens)} tokens · {who}"
    lead = f'<div class="et-caption"><span>{where}</span><span class="et-note">{of}</span></div>'
    grid = f'<div class="et-sites" style="--columns:{len(layers)}">{"".join(cells)}</div>'
    if look.order != "network":
        grid = _sorted_sites(ready, attention, look)
    alike = ""
    if all(times_uniform(row_of(ready, attention, name, look)).max() < _ALIKE for name in sites):
        alike = f'<div class="et-note" data-testid="alike">{_ALIKE_WORDS}</div>'
    return lead + grid + map_legend(look) + alike


def _sorted_sites(ready: Ready, attention: Attention, look: AttentionLook) -> str:
    """All sites in a row of their own order: those that read fewest tokens, or farthest, first."""
    found: list[tuple[float, str]] = []
    for name in attention.sites:
        site, row = Site.of(name), row_of(ready, attention, name, look)
        bits, pixels = map_facts(attention, row, look.query)
        kind = "reads coarser" if site.kind == "cross" else "self"
        where = f"{resolution(site.scale)} {site.part} {site.layer + 1}<br>{kind}"
        map_ = map_html(attention, row, look, site_words(name, attention.sites), f"attention:site:{name}")
        cell = (
            f'<div class="et-thumb" data-testid="{escape(name)}">{map_}<span class="et-label">{where}<br>'
            f"{bits:.1f} bits · {pixels:.0f} px</span></div>"
        )
        found.append((bits if look.order == "entropy" else -pixels, cell))
    first = "sharpest first (bits of entropy)" if look.order == "entropy" else "farthest first (mean distance)"
    cells = "".join(cell for _, cell in sorted(found, key=lambda entry: entry[0]))
    return f'<div class="et-note">{first}</div><div class="et-heads">{cells}</div>'


def _site_cell(ready: Ready, attention: Attention, look: AttentionLook, name: str | None, chosen: str) -> str:
    if name is None:
        return "<span></span>"
    site = Site.of(name)
    row = row_of(ready, attention, name, look)
    reads = f"≈ {tokens_words(row)}"
    if site.kind == "cross":
        reads = f"reads {resolution(source(site, attention.sites))} ≈ {tokens_words(row)}"
    map_ = map_html(attention, row, look, site_words(name, attention.sites), f"attention:site:{name}")
    mark = " et-chosen" if name == chosen else ""
    return f'<div class="et-thumb{mark}" data-testid="{escape(name)}">{map_}<span class="et-label">{reads}</span></div>'


def _heads(ready: Ready, attention: Attention, look: AttentionLook, name: str) -> str:
    rows = rows_of(ready, attention, name, look.query, look.direction)
    chosen = gathered(rows, look.head, look.gather)
    height, width = ready.frame.shape
    large = picture(
        data_url(over_frame(ready, look, chosen, None), is_lossless=True),
        site_words(name, attention.sites),
        key="pixel",
        marks=[marker((look.query[0] + 0.5) / width, (look.query[1] + 0.5) / height)],
        size=(width, height),
        classes="et-sharp",
    )
    facts = _facts(attention, look, chosen, head_words(look.head, look.gather, len(rows)))
    heads = _heads_in_order(attention, look, rows)
    mean = "" if look.head is None else _MEAN
    return f"{large}{facts}{map_legend(look)}{mean}{heads}"


def _facts(attention: Attention, look: AttentionLook, row: np.ndarray, who: str) -> str:
    """What the large map amounts to, in numbers."""
    token = int(row.argmax())
    peak = float(times_uniform(row)[token])
    x, y = attention.grid.pixel_of(token)
    bits, pixels = map_facts(attention, row, look.query)
    most = (
        f'most at <b data-testid="peak" data-token="{token}" data-weight="{row[token]:.7g}">({x}, {y})</b>:'
        f" <b>{peak:.3g}</b> × uniform"
    )
    if look.direction == "read by":
        given = f"gets <b>{float(row.mean()) * len(row):.2f}</b> × its even share · {most}"
        away = f"its readers lie <b>{pixels:.0f}</b> px away, on average"
    else:
        given = f"reads ≈ <b>{tokens_words(row)}</b> of {count(len(row))} tokens · {most}"
        away = f"entropy <b>{bits:.2f}</b> of {np.log2(len(row)):.2f} bits · <b>{pixels:.0f}</b> px away, on average"
    is_whole = look.direction == "reads" and (look.gather == "mean" or not who.endswith("heads"))
    total = f" · weights sum to {float(row.sum()):.4f}" if is_whole else ""
    return (
        f'<div class="et-caption"><span>{who}</span><span>{given}</span></div>'
        f'<div class="et-note" data-testid="map-facts">{away}{total}</div>'
    )


def _heads_in_order(attention: Attention, look: AttentionLook, rows: np.ndarray) -> str:
    cells: list[tuple[float, str]] = []
    for head, row in enumerate(rows):
        bits, pixels = map_facts(attention, row, look.query)
        map_ = map_html(attention, row, look, f"head {head + 1}", f"set:attention.head:{head}")
        mark = " et-chosen" if head == look.head else ""
        label = f"head {head + 1}<br>{bits:.1f} bits<br>{pixels:.0f} px away"
        place = {"network": float(head), "entropy": bits, "distance": -pixels}[look.order]
        cells.append((place, f'<div class="et-thumb{mark}">{map_}<span class="et-label">{label}</span></div>'))
    return f'<div class="et-heads">{"".join(cell for _, cell in sorted(cells, key=lambda cell: cell[0]))}</div>'
