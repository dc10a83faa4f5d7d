"""Does it matter here? What the frame loses without each part, and where attention goes to waste."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.html.attention.maps import AttentionLook, Site, map_html, site_words, tokens_words
from app.html.controls import (
    VISIBLE,
    part_words,
    percent,
    plain_bar,
    signed_bar,
    signed_legend,
    signed_limit,
    signed_picture,
)
from app.html.elements import ON_PICK, empty, escape, marker, panel
from app.html.moment import ARRAYS
from app.html.units import of_whole, resolution
from app.views.inspect.results import Attended, PartEffect

_ATTENTION = ("TPA", "attention")


def matters_html(
    parts: tuple[PartEffect, ...],
    key: object,
    *,
    chosen: str = "",
    query: tuple[int, int] | None = None,
    is_whole: bool = True,
) -> str:
    """A row for each part; the chosen one's effect as a picture. A click on a row sends `set:inspect.part:<name>`."""
    if not parts:
        nothing = empty("Nothing to ablate", "This network has no transformer and no skip connection to leave out.")
        return panel("matters", nothing)
    shown = next((part for part in parts if part.name == chosen), parts[0])
    rows = [_head(query), *(_row(part, parts, query, part is shown) for part in parts)]
    lead = (
        "Each part of the network is ablated in turn, and this image is decoded again. The change is in % of full "
        "brightness."
    )
    verdict = f'<div class="et-say" data-testid="verdict">{escape(_verdict(parts, query))}</div>' if is_whole else ""
    table = f'<div class="et-table">{"".join(rows)}</div>'
    return panel("matters", f'<div class="et-note">{lead}</div>', verdict, table, _map(shown, key, query))


def attended_html(attended: Attended, site: str, look: AttentionLook, key: object, *, base: str) -> str:
    """For the pixel's token: raw weights beside what is really handed over, and what goes to padding and sinks."""
    attention = attended.attention
    grid, look = attention.grid, replace(look, direction="attends to")  # both maps are rows, whatever is chosen
    token = grid.token_at(*look.query)
    name = site if site in attention.sites else attention.sites[0]
    raw, handed = ARRAYS.get(("handed", key, name, token), lambda: rows_at(attended, name, token), _nbytes)
    maps = [
        (raw, "attention", "α, mean of the heads"),
        (handed, "contribution", "‖αvW<sub>O</sub>‖, all heads"),
    ]
    cells = "".join(
        f'<figure class="et-thumb">{map_html(attention, row, look, words, "")}<figcaption class="et-label">'
        f"<b>{words}</b><br>{what}<br>≈ {tokens_words(row)} tokens</figcaption></figure>"
        for row, words, what in maps
    )
    alike = float(np.minimum(raw, handed).sum())
    said = (
        f"{site_words(name, attention.sites)}. The two maps share {of_whole(alike)} of their weight; "
        "where α is the larger, what arrives is small; where ‖αvW_O‖ is, it is large."
    )
    style = f"--n:{grid.columns};--base:url({base})"
    return panel(
        "attended",
        "<h4>Attention vs value-weighted</h4>",
        f'<div class="et-note">{escape(said)}</div>',
        f'<div class="et-pair">{cells}</div>',
        "<h4>Attention sinks and padding</h4>",
        _waste(attended, token, key),
        style=style,
    )


def _head(query: tuple[int, int] | None) -> str:
    pixel = f"pixel ({query[0]}, {query[1]})" if query else "pixel: click one"
    return f'<span class="et-note">without</span><span class="et-note">{pixel}</span><span class="et-note">image</span>'


def _row(part: PartEffect, parts: tuple[PartEffect, ...], query: tuple[int, int] | None, is_shown: bool) -> str:
    words, what = part_words(part.name)
    here = "–"
    if query is not None:
        limit = max(abs(_at(other, query)) for other in parts)
        here = f"{signed_bar(_at(part, query), limit)}<b>{percent(_at(part, query))}</b>"
    largest = max(other.mean_absolute for other in parts)
    whole = f"{plain_bar(part.mean_absolute, largest)}<b>{percent(part.mean_absolute, is_signed=False)}</b>"
    pick = f'data-k="set:inspect.part:{escape(part.name)}" {ON_PICK}'
    chosen = " et-on" if is_shown else ""
    return (
        f'<button class="et-part{chosen}" {pick} data-testid="part" aria-pressed="{"true" if is_shown else "false"}"'
        f' title="{escape(what)}">{escape(words)}</button>'
        f'<span class="et-measure">{here}</span><span class="et-measure">{whole}</span>'
    )


def _verdict(parts: tuple[PartEffect, ...], query: tuple[int, int] | None) -> str:
    """What may be concluded, in a sentence."""
    amounts = {part.name: abs(_at(part, query)) if query else part.mean_absolute for part in parts}
    where = "At this pixel" if query else "In this image, on average,"
    most = max(amounts, key=lambda name: amounts[name])
    decides = f"{where} “{part_words(most)[0]}” decides most: {percent(amounts[most], is_signed=False)}."
    by_kind = {name.partition(" ")[0]: amount for name, amount in amounts.items()}
    if not all(kind in by_kind for kind in _ATTENTION):
        return decides
    if by_kind["TPA"] < VISIBLE:
        return f"{decides} Without the transformer nothing visible changes: attention explains nothing here."
    if by_kind["attention"] < VISIBLE:
        return (
            f"{decides} The transformer counts ({percent(by_kind['TPA'], is_signed=False)}), but not where it "
            "attends to: "
            "the attention maps explain nothing here."
        )
    return f"{decides} Where it attends to counts, too: {percent(by_kind['attention'], is_signed=False)}."


def _map(part: PartEffect, key: object, query: tuple[int, int] | None) -> str:
    height, width = part.difference.shape
    limit = signed_limit(part.difference)
    marks = marker((query[0] + 0.5) / width, (query[1] + 0.5) / height) if query else ""
    words, what = part_words(part.name)
    image = signed_picture(part.difference, limit, f"change without {words}", (key, part.name), marks=marks)
    caption = f'<div class="et-caption"><span>{escape(words)}: {escape(what)}</span><span>without − with</span></div>'
    return f"{image}{caption}{signed_legend('the image becomes', limit)}"


def _at(part: PartEffect, query: tuple[int, int]) -> float:
    return float(part.difference[query[1], query[0]])


def rows_at(attended: Attended, site: str, token: int) -> np.ndarray:
    """Of one site, for one token: mean weights, and what is handed over as shares; "2 tokens"."""
    from etnet.inspection.mass import value_weighted

    attention = attended.attention
    raw = attention.rows(site, [token])[:, 0].mean(0)
    joint = value_weighted(attention, site, [token]).joint[0]
    return np.stack([raw.cpu().numpy(), (joint / joint.sum().clamp_min(1e-20)).cpu().numpy()])


def _waste(attended: Attended, token: int, key: object) -> str:
    attention = attended.attention
    waste, uniform = ARRAYS.get(("padding", key, token), lambda: padding_at(attended, token))
    sites = {name: Site.of(name) for name in attention.sites}
    scales = sorted({site.scale for site in sites.values()}, reverse=True)
    by_place = {(site.row, site.scale): name for name, site in sites.items()}
    cells = ["<span></span>", *(f"<b>{resolution(scale)}</b>" for scale in scales)]
    for row in dict.fromkeys(site.row for site in sites.values()):
        part, layer, kind = row
        reads = kind
        cells.append(f"<span>{part.capitalize()} {layer} <i>{reads}</i></span>")
        for scale in scales:
            name = by_place.get((row, scale))
            cells.append("<span>–</span>" if name is None else _waste_cell(attended, name, waste[name], token))
    grid = f'<div class="et-numbers" style="--columns:{len(scales)}">{"".join(cells)}</div>'
    note = (
        f"of this pixel’s attention, mean of the heads. On padding (the black border that makes sides divisible by 8): "
        f"{of_whole(uniform, 1)} is what uniform attention gives. A sink is a token that at least 9 of 10 "
        "queries give 4 × the uniform weight."
    )
    return f'{grid}<div class="et-note">{note}</div>'


def _waste_cell(attended: Attended, name: str, on_padding: float, token: int) -> str:
    mask = attended.sinks.get(name)
    if mask is None:
        sinks = "…"
    elif not mask.any():
        sinks = "no sink"
    else:
        rows = attended.attention.rows(name, [token])[:, 0].cpu().numpy()
        sinks = f"sinks {of_whole(float((rows * mask).sum(-1).mean()))}"
    return f"<span>padding {of_whole(on_padding, 1)}<br>{sinks}</span>"


def padding_at(attended: Attended, token: int) -> tuple[dict[str, float], float]:
    """Of a token's mean map at each site the share on padding, and what uniform attention gives."""
    from etnet.inspection.mass import mass_on, padding_shares

    attention = attended.attention
    shares = padding_shares(attention.grid)
    found = {
        site: float(mass_on(attention.rows(site, [token])[:, 0].mean(0), shares.to(attention.keys[site].device)))
        for site in attention.sites
    }
    return found, float(shares.mean())


def _nbytes(rows: np.ndarray) -> int:
    return rows.nbytes
