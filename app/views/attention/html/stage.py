"""The chosen site's map, large: whole pixels for a token, its numbers under the pointer, what it amounts to."""

from __future__ import annotations

import numpy as np

from app.html.attention.changed import changed_at, site_name
from app.html.attention.difference import difference_tokens
from app.html.attention.keep import kept, kept_words
from app.html.attention.maps import (
    Site,
    base_url,
    head_words,
    large_map,
    map_facts,
    patch_size,
    source,
    tokens_of,
    tokens_words,
)
from app.html.attention.not_maps import explained_html
from app.html.elements import chip, escape, icon_button, panel, picture
from app.html.moment import PICTURES
from app.html.pictures import lag_line, reconstruction_image
from app.html.units import count, resolution, significant
from app.views.attention.html.code import code_block, row_block
from app.views.attention.html.pins import Difference, difference_of, pin_trouble, pin_words
from app.views.attention.html.shown import Shown, missing, not_button, shown_of
from app.views.attention.state import Over
from app.views.naming import title_of
from app.views.page import Page
from app.views.reconstruction.state import tones_of
from etnet.render.attention import times_uniform
from etnet.render.encode import data_url
from etnet.render.tone import tone_map


def stage_html(page: Page) -> tuple[str, str, str, str]:
    """Title, note, tools and body of the card."""
    lag = lag_line(page.ready, page.state.index, page.working, page.failed)
    shown = shown_of(page)
    if shown is None:
        return "Attention", "", "", panel("site", lag, _frame(page), missing(page))
    site, head = shown.site, shown.look.head
    note = escape(head_words(head, shown.look.gather, shown.num_heads))
    over = {"not": lambda _: explained_html(), "python": code_block, "row": row_block}.get(shown.slice_.over)
    if over is not None:
        return site_name(site), note, _tools(shown), panel("site", lag, over(shown))
    return site_name(site), note, _tools(shown), panel("site", lag, _line(shown), _map(shown), _foot(shown))


def _frame(page: Page) -> str:
    """The reconstruction, so that a pixel can be chosen."""
    ready = page.ready
    if ready is None or page.moment is None:
        return ""
    tones = tones_of(page)
    url = PICTURES.text(("frame", ready.key, tones), lambda: data_url(reconstruction_image(ready, tones), False))
    height, width = ready.frame.shape
    return picture(url, "Reconstruction", key="pixel", size=(width, height), classes="et-large-map")


def _tools(shown: Shown) -> str:
    slice_ = shown.slice_
    slot = "a" if slice_.pin_a is None else "b"
    x, y = shown.look.query
    where = "" if (x, y) == shown.page.state.query else f":{x},{y}"

    def over(word: Over, name: str, title: str) -> str:
        is_on = slice_.over == word
        return icon_button(f"set:attention.over:{'none' if is_on else word}", name, title, is_on=is_on)

    return (
        not_button(slice_)
        + icon_button(f"attention:pin:{slot}{where}", "pin", f"Pin this map with its moment as {slot.upper()}")
        + over("row", "table", "The row as text: copy, or save as CSV")
        + over("python", "code", "Copy as Python")
    )


def _line(shown: Shown) -> str:
    """Direction and scales in words, the library's name of the site, and the token."""
    words = library_words(shown)
    name = f'<code title="as the library calls it; the token">{escape(shown.site)} · {shown.token}</code>'
    line = f'<div class="et-map-line" data-testid="map-line"><span>{escape(words)}</span>{name}</div>'
    return f"{line}{_instead(shown)}{_without_pin(shown)}"


def _instead(shown: Shown) -> str:
    """That the network has not what was chosen, where another one had it."""
    asked, said = shown.slice_, []
    if asked.site != shown.site:
        said.append(f"has no site {asked.site}, so its first one is shown")
    if asked.head is not None and shown.look.head is None:
        said.append(f"has no head {asked.head}, so all heads are shown")
    model = shown.page.model.title
    return f'<div class="et-note" data-testid="instead">{escape(model)} {"; it ".join(said)}.</div>' if said else ""


def _without_pin(shown: Shown) -> str:
    """Why the map stands alone though it is held against a pin."""
    if not (trouble := pin_trouble(shown)):
        return ""
    said = f"Pin {shown.slice_.compare.upper()} cannot be computed, so the map stands alone: {trouble}"
    return f'<div class="et-note" data-testid="no-pin">{escape(said)}</div>'


def library_words(shown: Shown) -> str:
    """What the map shows, as the library says it."""
    from etnet.inspection.sites import Site as Named

    return Named.of(shown.site).in_words(shown.coarsest, shown.look.direction)


def _map(shown: Shown) -> str:
    base = base_url(shown.ready, shown.attention, shown.look.tones, patch_size())
    apart = difference_of(shown)
    if apart is not None:
        return _difference(shown, apart, base)
    row = shown.row()
    image = large_map(
        shown.grid,
        tokens_of(shown.attention, row, shown.look),
        times_uniform(row),
        base,
        shown.site,
        query=shown.look.query,
        is_smooth=shown.look.is_smooth,
    )
    key = Site.of(shown.site)
    reads = resolution(source(key, shown.attention.sites) if key.kind == "cross" else key.scale)
    num = count(shown.grid.num_tokens)
    if shown.look.direction == "attends to":
        kept = kept_words(row, shown.look.keep)
        left = f"attends to {reads} · {kept or f'{tokens_words(row)} effective tokens of {num}'}"
    elif shown.look.head is None and shown.look.gather != "mean":
        left = f"{shown.look.gather} of the heads, token by token"  # its sum says nothing of what is received
    else:
        left = f"received {float(row.sum()):.2f} × uniform"
    peak = int(row.argmax())
    at = divmod(peak, shown.grid.columns)
    most = f"peak {significant(times_uniform(row)[peak])} × uniform at token {at[1]}, {at[0]}"
    right = (
        f'<span class="et-chip" data-etv-readout><span data-testid="peak" data-token="{peak}"'
        f' data-weight="{row[peak]:.7g}">{most}</span>'
        "</span>"
    )
    badge = f'<span class="et-chip et-exact" data-testid="reads">{escape(left)}</span>'
    return _staged(shown, image, badge + right)


def _difference(shown: Shown, apart: Difference, base: str) -> str:
    grid, found = shown.grid, apart.found
    ratio = found.log_ratio.cpu().numpy()
    weights = np.abs(found.difference.cpu().numpy())  # a large ratio of two small weights says little
    drawn = difference_tokens(ratio, found.limit, grid.rows, grid.columns, shown.look.opacity)
    if shown.look.keep != "all":
        drawn[~kept(weights, shown.look.keep).reshape(grid.rows, grid.columns), 3] = 0
    image = large_map(
        grid,
        drawn,
        ratio,
        base,
        "now − then",
        query=shown.look.query,
        unit="log₂ now / then",
        is_smooth=shown.look.is_smooth,
    )
    tones = shown.look.tones
    frames = "".join(
        f'<figure><span class="et-picture"><img alt="{words}" src="'
        f'{data_url(tone_map(each.frame.float().cpu().numpy(), tones.tone, tones.is_linear_light), False)}"></span>'
        f'<figcaption class="et-label"><b>{words}</b> window {each.index} · {escape(model)}</figcaption></figure>'
        for words, each, model in (
            ("now", found.now, shown.page.model.title),
            ("then", found.then, title_of(shown.page, apart.pinned.request.model_id)),
        )
    )
    shares = [each.map.cpu().numpy() / max(float(each.map.sum()), 1e-20) for each in (found.now, found.then)]
    shared = float(np.minimum(*shares).sum())  # columns, and the largest or smallest of the heads, sum to no 1
    said = f"now and {apart.slot.upper()} share {100 * shared:.0f} % of their weight"
    if left := kept_words(weights, shown.look.keep):
        said += f" · {left} of the difference"
    badge = f'<span class="et-chip et-plain" data-testid="a-minus-b">{said}</span>'
    readout = '<span class="et-chip" data-etv-readout>point at a token</span>'
    return (
        f"{_staged(shown, image, badge + readout)}"
        f'<div class="et-pair et-frames-below" title="{escape(pin_words(shown.page, apart.pinned))}">{frames}</div>'
    )


def _staged(shown: Shown, image: str, badges: str) -> str:
    """A picture with what is said of it; what is changed at its site is marked on it."""
    mark = changed_at(shown.ready.request.intervention, shown.site)
    changed = f'<div class="et-mark">{chip(mark, "warning", "Changed on purpose; see Change")}</div>' if mark else ""
    return (
        f'<div class="et-stage-map" data-etv-focus="1" tabindex="0">{image}{changed}'
        f'<div class="et-badges">{badges}</div></div>'
    )


def _foot(shown: Shown) -> str:
    """Two entropies, each by its name, and how far the map looks."""
    import torch

    from etnet.inspection.entropy import head_entropies

    row, rows = shown.row(), shown.rows()
    bits, pixels = map_facts(shown.attention, row, shown.look.query)
    most = f"of {np.log2(len(row)):.2f}"
    if shown.look.head is not None or shown.look.gather != "mean":
        sharp = f"entropy <b>{bits:.2f}</b> {most} bits"
    else:
        both = head_entropies(torch.from_numpy(rows)[:, None])
        of_heads = float(both.mean_of_heads)
        sharp = f"entropy <b>{bits:.2f}</b> (mean map) <b>{of_heads:.2f}</b> (mean of heads) {most} bits"
    is_whole = shown.look.direction == "attends to" and (shown.look.head is not None or shown.look.gather == "mean")
    total = f'<span title="sum of the row">Σ {float(row.sum()):.4f}</span>' if is_whole else ""
    return (
        f'<div class="et-caption" data-testid="map-facts"><span>{sharp}</span>'
        f'<span title="mean distance"><b>{pixels:.0f}</b> px</span>{total}</div>'
    )
