"""Where the network looks from one pixel: all sites in a grid, or one site with its heads.

Clicks send `site:<name>` on a map of the grid, `head:<n>` on a head, `head:mean`, `pixel` on the large map (its box is
the sensor), and `heads:close` to go back to all sites.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from app.present.html import empty, escape, legend, marker, panel, picture
from app.present.moment import ARRAYS, PICTURES
from app.present.pictures import Tones, lag_line, reconstruction_image
from app.present.words import count, fraction, resolution
from app.view_state import ViewState
from app.wishes import Failed, Ready, Working
from etnet.render.attention import HIGHEST, LOWEST, composite, dimmed, on_grid, overlay, times_uniform, tokens_read
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.nets.attention import Attention

MapRange = Literal["shared", "per map"]
_ALIKE = 2.0
"""× uniform that no token reaches in a row which reads all of them almost alike."""
_ALIKE_WORDS = "This network reads every place almost alike here: its attention tells little."
_BASE_PIXELS = 4
"""Pixels a token of the dimmed frame under the small maps."""


@dataclass(frozen=True, slots=True)
class AttentionLook:
    """How attention is shown: from which pixel, one head or the mean (`None`), and how strongly coloured."""

    query: tuple[int, int]
    head: int | None = None
    opacity: float = 1.0
    map_range: MapRange = "shared"
    tones: Tones = field(default_factory=Tones)

    @staticmethod
    def of(state: ViewState, is_linear_light: bool) -> AttentionLook | None:
        """As a visitor chose; `None` until he has chosen a pixel."""
        if state.query is None:
            return None
        return AttentionLook(state.query, state.head, state.overlay, state.map_range, Tones.of(state, is_linear_light))


class Site(NamedTuple):
    """A site's name taken apart: "scale2.decoder.0.cross"."""

    scale: int
    part: str
    layer: int
    kind: str

    @staticmethod
    def of(name: str) -> Site:
        """Parse a name that the network gave."""
        scale, part, index, kind = name.split(".")
        return Site(int(scale.removeprefix("scale")), part, int(index), kind)

    @property
    def row(self) -> tuple[str, int, str]:
        """Sites in one row of the grid differ by scale alone."""
        return self.part, self.layer, self.kind


def site_words(name: str, sites: tuple[str, ...]) -> str:
    """A site in words: "1/4 · decoder 1, cross-attention: 1/4 reads 1/8"."""
    site = Site.of(name)
    own = resolution(site.scale)
    if site.kind == "self":
        return f"{own} · {site.part} {site.layer + 1}, self-attention: {own} reads itself"
    return f"{own} · {site.part} {site.layer + 1}, cross-attention: {own} reads {resolution(_source(site, sites))}"


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
    variables = f"--n:{attention.grid.columns};--base:url({_base_url(ready, attention, look.tones)})"
    return panel("attention", lag, body, style=variables)


def attention_image(ready: Ready, look: AttentionLook, site: str) -> UInt8[np.ndarray, "h w 3"] | None:
    """One map over the dimmed frame at sensor size, the query marked; `None` where this site was not probed."""
    if ready.attention is None or site not in ready.attention.sites:
        return None
    row = _row(ready, ready.attention, site, look)
    return ARRAYS.get(
        ("attention image", ready.key, look, site), lambda: _over_frame(ready, look, row, look.query), _nbytes
    )


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
        num_read = _tokens(_row(ready, attention, site, look))
        words = f"reads ≈ {num_read} of {count(attention.grid.num_tokens)} places · {site_words(site, attention.sites)}"
        return f'{shown}<div class="et-note">{escape(words)}</div>'

    return panel("places", PICTURES.text(("places", ready.key, look, site, on_pick), make))


def _over_frame(
    ready: Ready, look: AttentionLook, row: np.ndarray, query: tuple[int, int] | None
) -> UInt8[np.ndarray, "h w 3"]:
    assert ready.attention is not None
    grid = ready.attention.grid
    tokens = overlay(row, grid.rows, grid.columns, _highest(row, look), look.opacity)
    return composite(reconstruction_image(ready, look.tones), tokens, grid.top, grid.left, _patch(), query)


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
    who = "mean of all heads" if look.head is None else f"head {look.head + 1}"
    of = f"of {count(attention.grid.num_tokens)} tokens · {who}"
    lead = f'<div class="et-caption et-lead"><span>{where}</span><span class="et-note">{of}</span></div>'
    grid = f'<div class="et-sites" style="--columns:{len(scales)}">{"".join(cells)}</div>'
    hint = '<div class="et-note">click a map to choose that site</div>' if on_pick else ""
    if all(times_uniform(_row(ready, attention, name, look)).max() < _ALIKE for name in sites):
        hint = f'<div class="et-note" data-testid="alike">{_ALIKE_WORDS}</div>{hint}'
    return lead + _legend(look) + grid + hint


def _site_cell(ready: Ready, attention: Attention, look: AttentionLook, name: str | None, on_pick: str) -> str:
    if name is None:
        return "<span></span>"
    site = Site.of(name)
    row = _row(ready, attention, name, look)
    reads = f"reads ≈ {_tokens(row)}"
    if site.kind == "cross":
        reads = f"{resolution(site.scale)} reads {resolution(_source(site, attention.sites))}<br>≈ {_tokens(row)}"
    map_ = _map(attention, look, row, site_words(name, attention.sites), f"site:{name}", on_pick)
    return f'<div class="et-thumb" data-testid="{escape(name)}">{map_}<span class="et-label">{reads}</span></div>'


def _heads(ready: Ready, attention: Attention, look: AttentionLook, name: str, on_pick: str) -> str:
    rows = _rows(ready, attention, name, look.query)
    chosen = rows.mean(0) if look.head is None or look.head >= len(rows) else rows[look.head]
    who = "mean of all heads" if look.head is None or look.head >= len(rows) else f"head {look.head + 1}"
    num_read = _tokens(chosen)
    token = int(chosen.argmax())
    peak = float(times_uniform(chosen)[token])
    x, y = attention.grid.pixel_of(token)
    height, width = ready.frame.shape
    large = picture(
        data_url(_over_frame(ready, look, chosen, None), is_lossless=True),
        site_words(name, attention.sites),
        key="pixel",
        on_pick=on_pick,
        marks=[marker((look.query[0] + 0.5) / width, (look.query[1] + 0.5) / height)],
        size=(width, height),
        classes="et-sharp",
    )
    facts = (
        f'<div class="et-caption"><span>{who}</span><span>reads ≈ <b>{num_read}</b> of {count(rows.shape[-1])} tokens'
        f' · most at <b data-testid="peak" data-token="{token}" data-weight="{chosen[token]:.7g}">({x}, {y})</b>:'
        f" <b>{peak:.3g}</b> × uniform</span></div>"
    )
    cells: list[str] = []
    for head, row in enumerate(rows):
        map_ = _map(attention, look, row, f"head {head + 1}", f"head:{head}", on_pick)
        label = f"head {head + 1}<br>reads ≈ {_tokens(row)}"
        mark = " et-chosen" if head == look.head else ""
        cells.append(f'<div class="et-thumb{mark}">{map_}<span class="et-label">{label}</span></div>')
    lead = f'<div class="et-lead">{escape(site_words(name, attention.sites))}</div>'
    back = (
        f'<button class="et-back" data-k="heads:close" {on_pick}>All sites</button>'
        f'<button class="et-back" data-k="head:mean" {on_pick}>Mean of all heads</button>'
        if on_pick
        else ""
    )
    heads = f'<div class="et-heads">{"".join(cells)}</div>'
    return f'<div class="et-chips">{back}</div>{lead}{large}{facts}{_legend(look)}{heads}'


def _map(attention: Attention, look: AttentionLook, row: np.ndarray, alt: str, key: str, on_pick: str) -> str:
    grid = attention.grid
    tokens = overlay(row, grid.rows, grid.columns, _highest(row, look), look.opacity)
    row_at, column_at = divmod(grid.token_at(*look.query), grid.columns)
    marks = [marker((column_at + 0.5) / grid.columns, (row_at + 0.5) / grid.rows)]
    size = (grid.columns, grid.rows)
    return picture(
        data_url(tokens, is_lossless=True), alt, key=key, on_pick=on_pick, marks=marks, size=size, classes="et-map"
    )


def _legend(look: AttentionLook) -> str:
    powers = np.log2(HIGHEST / LOWEST)
    if look.map_range == "per map":
        return legend(
            "attention, each map by its own range", css_gradient(sequential()), [(0, "1/4"), (1, "its maximum")]
        )
    values = (LOWEST, 1.0, 4.0, HIGHEST)
    ticks = [(float(np.log2(value / LOWEST) / powers), f"{fraction(value)} ×") for value in values]
    return legend("attention, × uniform (1 × = all tokens read alike)", css_gradient(sequential()), ticks)


def _rows(ready: Ready, attention: Attention, site: str, query: tuple[int, int]) -> Float[np.ndarray, "heads keys"]:
    token = attention.grid.token_at(*query)
    key = ("rows", ready.key, site, token)
    return ARRAYS.get(key, lambda: attention.rows(site, [token])[:, 0].cpu().numpy(), lambda rows: rows.nbytes)


def _row(ready: Ready, attention: Attention, site: str, look: AttentionLook) -> Float[np.ndarray, " keys"]:
    rows = _rows(ready, attention, site, look.query)
    return rows.mean(0) if look.head is None or look.head >= len(rows) else rows[look.head]


def _tokens(row: np.ndarray) -> str:
    return count(max(1, round(float(tokens_read(row)))))


def _highest(row: np.ndarray, look: AttentionLook) -> float:
    return HIGHEST if look.map_range == "shared" else float(times_uniform(row).max())


def _source(site: Site, sites: tuple[str, ...]) -> int:
    """The scale whose tokens a cross-attention reads: the next coarser one; the coarsest reads itself."""
    return min(site.scale + 1, max(Site.of(name).scale for name in sites))


def _patch() -> int:
    from etnet.nets.padding import PATCH  # needs torch, which is there once attention is

    return PATCH


def _base_url(ready: Ready, attention: Attention, tones: Tones) -> str:
    grid = attention.grid

    def make() -> str:
        grey = on_grid(reconstruction_image(ready, tones), grid.rows, grid.columns, grid.top, grid.left, _patch())
        step = max(1, _patch() // _BASE_PIXELS)
        rows, columns = grey.shape[0] // step, grey.shape[1] // step
        small = grey.reshape(rows, step, columns, step).mean((1, 3)).astype(np.uint8)
        return data_url(dimmed(small), is_lossless=False)

    return PICTURES.text(("base", ready.key, tones), make)
