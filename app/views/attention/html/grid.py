"""Where the network looks from one pixel: all sites in a grid, or one site with its heads.

Clicks send `site:<name>` on a map of the grid, `head:<n>` on a head, `head:mean`, `pixel` on the large map (its box is
the sensor), and `heads:close` to go back to all sites.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from app.engine.requests import Failed, Ready, Working
from app.html.elements import empty, escape, marker, panel, picture
from app.html.moment import ARRAYS, PICTURES
from app.html.pictures import lag_line
from app.html.units import count, resolution
from app.state.view_state import ViewState
from app.views.attention.html.maps import (
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
from etnet.render.attention import times_uniform
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.nets.attention import Attention

_ALIKE = 2.0
"""× uniform that no token reaches in a row which reads all of them almost alike."""
_ALIKE_WORDS = "This network reads every place almost alike here: its attention tells little."


def attention_html(
    ready: Ready | None,
    look: AttentionLook | None,
    *,
    wanted: int | None = None,
    opened: str | None = None,
    working: Working | None = None,
    failed: Failed | None = None,
    on_pick: str = "",
) -> str:
    """The grid of all sites, or the heads of `opened`. Says what is missing when there is nothing to show."""
    lag = lag_line(ready, wanted, working, failed)
    if look is None:
        explanation = "Click into the reconstruction: every map then shows what the network reads to redraw that spot."
        return panel("attention", empty("Choose a pixel", explanation), lag)
    if ready is None or ready.attention is None:
        why = "It is computed together with the next image of this window."
        return panel("attention", empty("No attention for this window yet", why), lag)
    attention = ready.attention
    if not attention.sites:
        return panel("attention", empty("This model has no attention", "It is made of convolutions alone."), lag)
    is_opened = opened in attention.sites
    key = ("attention", ready.key, look, opened if is_opened else None, on_pick)
    body = PICTURES.text(
        key,
        lambda: (
            _heads(ready, attention, look, str(opened), on_pick)
            if is_opened
            else _sites(ready, attention, look, on_pick)
        ),
    )
    variables = f"--n:{attention.grid.columns};--base:url({base_url(ready, attention, look.tones)})"
    return panel("attention", lag, body, style=variables)


def attention_image(ready: Ready, look: AttentionLook, site: str) -> UInt8[np.ndarray, "h w 3"] | None:
    """One map over the dimmed frame at sensor size, the query marked; `None` where this site was not probed."""
    if ready.attention is None or site not in ready.attention.sites:
        return None
    row = row_of(ready, ready.attention, site, look)
    return ARRAYS.get(
        ("attention image", ready.key, look, site), lambda: over_frame(ready, look, row, look.query), _nbytes
    )


def sites_behind(ready: Ready | None, look: AttentionLook | None, state: ViewState) -> tuple[str, ...]:
    """The sites whose maps stand behind the frame: the chosen layer at every scale, the finest first.

    None unless they are asked for, nor in the front view, where they would be hidden.
    """
    if ready is None or ready.attention is None or look is None:
        return ()
    if not state.inside.shows_planes or state.camera == "front" or state.workspace == "demo":
        return ()
    layer = state.site.partition(".")[2]
    return tuple(sorted(name for name in ready.attention.sites if name.partition(".")[2] == layer))


def places_html(ready: Ready | None, look: AttentionLook | None, site: str, *, on_pick: str = "") -> str:
    """One map alone, large, for those who do not ask for more; says what to do when there is nothing to show."""
    attention = None if ready is None else ready.attention
    if look is None:
        return panel("places", empty("Touch a picture", "Then this shows what the network reads to redraw that spot."))
    if ready is None or attention is None or site not in attention.sites:
        return panel("places", empty("One moment", "It is computed together with the next image."))

    def make() -> str:
        image = attention_image(ready, look, site)
        assert image is not None
        height, width = ready.frame.shape
        name = f"What pixel {look.query} reads"
        shown = picture(data_url(image, is_lossless=False), name, key="pixel", on_pick=on_pick, size=(width, height))
        words = site_words(site, attention.sites)
        return f'{shown}<div class="et-note">{escape(words)}</div>'

    return panel("places", PICTURES.text(("places", ready.key, look, site, on_pick), make))


def _nbytes(array: np.ndarray) -> int:
    return array.nbytes


def _sites(ready: Ready, attention: Attention, look: AttentionLook, on_pick: str) -> str:
    sites = {name: Site.of(name) for name in attention.sites}
    scales = sorted({site.scale for site in sites.values()}, reverse=True)
    by_place = {(site.row, site.scale): name for name, site in sites.items()}
    cells = ["<span></span>"]
    for scale in scales:
        rank = "coarsest" if scale == scales[0] else "finest" if scale == scales[-1] else ""
        cells.append(f'<div class="et-head"><b>{resolution(scale)}</b><span>{rank or "&nbsp;"}</span></div>')
    for row in dict.fromkeys(site.row for site in sites.values()):
        part, layer, kind = row
        what = (
            "reads the coarser scale" if kind == "cross" else "self-attention" if part == "encoder" else "reads itself"
        )
        cells.append(f'<div class="et-name"><b>{part.capitalize()} {layer + 1}</b><span>{what}</span></div>')
        cells += [_site_cell(ready, attention, look, by_place.get((row, scale)), on_pick) for scale in scales]
    where = f"What pixel ({look.query[0]}, {look.query[1]}) reads"
    who = head_words(look.head, look.gather)
    of = f"of {count(attention.grid.num_tokens)} tokens · {who}"
    lead = f'<div class="et-caption et-lead"><span>{where}</span><span class="et-note">{of}</span></div>'
    grid = f'<div class="et-sites" style="--columns:{len(scales)}">{"".join(cells)}</div>'
    if look.order != "network":
        grid = _sorted_sites(ready, attention, look, on_pick)
    hint = '<div class="et-note">click a map to choose that site</div>' if on_pick else ""
    if all(times_uniform(row_of(ready, attention, name, look)).max() < _ALIKE for name in sites):
        hint = f'<div class="et-note" data-testid="alike">{_ALIKE_WORDS}</div>{hint}'
    return lead + map_legend(look) + grid + hint


def _sorted_sites(ready: Ready, attention: Attention, look: AttentionLook, on_pick: str) -> str:
    """All sites in a row of their own order: those that read fewest tokens, or farthest, first."""
    found: list[tuple[float, str]] = []
    for name in attention.sites:
        site, row = Site.of(name), row_of(ready, attention, name, look)
        bits, pixels = map_facts(attention, row, look.query)
        kind = "reads coarser" if site.kind == "cross" else "self"
        where = f"{resolution(site.scale)} {site.part} {site.layer + 1}<br>{kind}"
        map_ = map_html(attention, row, look, site_words(name, attention.sites), f"site:{name}", on_pick)
        cell = (
            f'<div class="et-thumb" data-testid="{escape(name)}">{map_}<span class="et-label">{where}<br>'
            f"{bits:.1f} bits · {pixels:.0f} px</span></div>"
        )
        found.append((bits if look.order == "entropy" else -pixels, cell))
    first = "sharpest first (bits of entropy)" if look.order == "entropy" else "farthest first (mean distance)"
    cells = "".join(cell for _, cell in sorted(found, key=lambda entry: entry[0]))
    return f'<div class="et-note">{first}</div><div class="et-heads">{cells}</div>'


def _site_cell(ready: Ready, attention: Attention, look: AttentionLook, name: str | None, on_pick: str) -> str:
    if name is None:
        return "<span></span>"
    site = Site.of(name)
    row = row_of(ready, attention, name, look)
    reads = f"reads ≈ {tokens_words(row)}"
    if site.kind == "cross":
        reads = f"{resolution(site.scale)} reads {resolution(source(site, attention.sites))}<br>≈ {tokens_words(row)}"
    map_ = map_html(attention, row, look, site_words(name, attention.sites), f"site:{name}", on_pick)
    return f'<div class="et-thumb" data-testid="{escape(name)}">{map_}<span class="et-label">{reads}</span></div>'


def _heads(ready: Ready, attention: Attention, look: AttentionLook, name: str, on_pick: str) -> str:
    rows = rows_of(ready, attention, name, look.query, look.direction)
    chosen = gathered(rows, look.head, look.gather)
    height, width = ready.frame.shape
    large = picture(
        data_url(over_frame(ready, look, chosen, None), is_lossless=True),
        site_words(name, attention.sites),
        key="pixel",
        on_pick=on_pick,
        marks=[marker((look.query[0] + 0.5) / width, (look.query[1] + 0.5) / height)],
        size=(width, height),
        classes="et-sharp",
    )
    facts = _facts(attention, look, chosen, head_words(look.head, look.gather, len(rows)))
    heads = _heads_in_order(attention, look, rows, on_pick)
    lead = f'<div class="et-lead">{escape(site_words(name, attention.sites))}</div>'
    back = (
        f'<button class="et-back" data-k="heads:close" {on_pick}>All sites</button>'
        f'<button class="et-back" data-k="head:mean" {on_pick}>Mean of all heads</button>'
        if on_pick
        else ""
    )
    return f'<div class="et-chips">{back}</div>{lead}{large}{facts}{map_legend(look)}{heads}'


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


def _heads_in_order(attention: Attention, look: AttentionLook, rows: np.ndarray, on_pick: str) -> str:
    cells: list[tuple[float, str]] = []
    for head, row in enumerate(rows):
        bits, pixels = map_facts(attention, row, look.query)
        map_ = map_html(attention, row, look, f"head {head + 1}", f"head:{head}", on_pick)
        mark = " et-chosen" if head == look.head else ""
        label = f"head {head + 1}<br>{bits:.1f} bits<br>{pixels:.0f} px away"
        place = {"network": float(head), "entropy": bits, "distance": -pixels}[look.order]
        cells.append((place, f'<div class="et-thumb{mark}">{map_}<span class="et-label">{label}</span></div>'))
    return f'<div class="et-heads">{"".join(cell for _, cell in sorted(cells, key=lambda cell: cell[0]))}</div>'
