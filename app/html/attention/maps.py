"""One attention map: which row it is, how it is coloured, what it amounts to. The panels are made of these."""

from __future__ import annotations

from base64 import b64encode
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8

from app.engine.requests import Ready
from app.html.attention.changed import site_name
from app.html.attention.keep import kept
from app.html.attention.look import AttentionLook, Direction, Gather
from app.html.elements import ON_PICK, empty, escape, legend, marker, panel, picture
from app.html.moment import ARRAYS, PICTURES
from app.html.pictures import Tones, reconstruction_image
from app.html.units import count, fraction, resolution
from etnet.render.attention import (
    HIGHEST,
    LOWEST,
    composite,
    dimmed,
    level_overlay,
    linear_level,
    log_level,
    on_grid,
    times_uniform,
    tokens_read,
)
from etnet.render.colours import css_gradient, sequential
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.nets.attention import Attention
    from etnet.nets.padding import TokenGrid

BASE_PIXELS = 4
"""Pixels a token of the dimmed frame under the small maps."""
MOST_NUMBERS = 65_536
"""Of a map that are sent with it for the pointer: at most a third of a megabyte."""
GATHERED: dict[Gather, str] = {
    "mean": "mean",
    "max": "max",
    "min": "min",
}


class Site(NamedTuple):
    """A site's name taken apart: "scale2.decoder.0.cross"."""

    scale: int
    part: str
    layer: int
    kind: str

    @staticmethod
    def of(name: str) -> Site:
        """Parse a name that the network gave."""
        return _site(name)

    @property
    def row(self) -> tuple[str, int, str]:
        """Sites in one row of the grid differ by scale alone."""
        return self.part, self.layer, self.kind


@lru_cache(maxsize=256)
def _site(name: str) -> Site:
    scale, part, index, kind = name.split(".")
    return Site(int(scale.removeprefix("scale")), part, int(index), kind)


def site_words(name: str, sites: tuple[str, ...]) -> str:
    """A site in words: "1/4 decoder 0, cross: 1/4 attends to 1/8"."""
    site = Site.of(name)
    own = resolution(site.scale)
    reads = "itself" if site.kind == "self" else resolution(source(site, sites))
    return f"{site_name(name)}: {own} attends to {reads}"


def source(site: Site, sites: tuple[str, ...]) -> int:
    """The scale whose tokens a cross-attention reads: the next coarser one; the coarsest reads itself."""
    return min(site.scale + 1, max(Site.of(name).scale for name in sites))


def rows_of(
    ready: Ready, attention: Attention, site: str, query: tuple[int, int], direction: Direction = "attends to"
) -> Float[np.ndarray, "heads tokens"]:
    """What the pixel's token reads; or, "attended by", what each token gives to it (those need not sum to 1)."""
    token = attention.grid.token_at(*query)

    def make() -> np.ndarray:
        if direction == "attended by":
            return attention.columns(site, [token])[..., 0].cpu().numpy()
        return attention.rows(site, [token])[:, 0].cpu().numpy()

    return ARRAYS.get(("rows", ready.key, site, token, direction), make, lambda rows: rows.nbytes)


def row_of(ready: Ready, attention: Attention, site: str, look: AttentionLook) -> Float[np.ndarray, " tokens"]:
    """The map of one head, or of all heads gathered."""
    return gathered(rows_of(ready, attention, site, look.query, look.direction), look.head, look.gather)


def gathered(rows: Float[np.ndarray, "heads tokens"], head: int | None, gather: Gather) -> Float[np.ndarray, " tokens"]:
    """One head, or the mean, largest or smallest over heads, token by token."""
    if head is not None and head < len(rows):
        return rows[head]
    return rows.mean(0) if gather == "mean" else rows.max(0) if gather == "max" else rows.min(0)


def site_in(attention: Attention, site: str) -> str:
    """`site`, or the first of this network's where it has none such."""
    return site if site in attention.sites else attention.sites[0]


def head_words(head: int | None, gather: Gather, num_heads: int | None = None) -> str:
    """ "head 3", counted from 0 as the library does, or "mean of 4 heads"."""
    if head is not None and (num_heads is None or head < num_heads):
        return f"head {head}"
    return f"{GATHERED[gather]} of {num_heads if num_heads is not None else 'all'} heads"


def tokens_words(row: np.ndarray) -> str:
    """To how many tokens a map amounts; a map that does not sum to 1 is taken as shares."""
    share = row / max(float(row.sum()), 1e-30)
    return count(max(1, round(float(tokens_read(share)))))


def map_facts(attention: Attention, row: np.ndarray, query: tuple[int, int]) -> tuple[float, float]:
    """A map's entropy (bits), and the mean distance (pixels) from the query's token to what it reads."""
    import torch

    from etnet.inspection.entropy import map_numbers

    numbers = map_numbers(torch.from_numpy(row)[None, None], attention.grid, [attention.grid.token_at(*query)])
    return float(numbers.entropy), float(numbers.distance)


def highest_of(row: np.ndarray, look: AttentionLook) -> float:
    """× uniform at which the colours end. A column has a range of its own: its sum is not 1, and few are large."""
    if look.map_range == "shared" and look.direction == "attends to":
        return HIGHEST
    largest = max(float(times_uniform(row).max()), 2 * LOWEST)
    return largest if look.map_range == "per map" else float(2 ** np.ceil(np.log2(largest)))


def level_of(row: np.ndarray, look: AttentionLook) -> np.ndarray:
    """A map's values as places on its colour scale, 0 … 1."""
    relative = times_uniform(row)
    highest = highest_of(row, look)
    return linear_level(relative, highest) if look.is_linear else log_level(relative, highest)


def tokens_of(attention: Attention, row: np.ndarray, look: AttentionLook) -> UInt8[np.ndarray, "rows columns 4"]:
    """A map as one RGBA pixel a token; tokens that are not kept are clear."""
    grid = attention.grid
    drawn = level_overlay(level_of(row, look).reshape(grid.rows, grid.columns), look.opacity)
    if look.keep != "all":
        drawn[~kept(row, look.keep).reshape(grid.rows, grid.columns), 3] = 0
    return drawn


def over_frame(
    ready: Ready, look: AttentionLook, row: np.ndarray, query: tuple[int, int] | None
) -> UInt8[np.ndarray, "h w 3"]:
    """A map over the dimmed frame at sensor size; the query marked, if one is given."""
    assert ready.attention is not None
    grid = ready.attention.grid
    tokens = tokens_of(ready.attention, row, look)
    grey = reconstruction_image(ready, look.tones)
    return composite(grey, tokens, grid.top, grid.left, patch_size(), query, look.is_smooth)


def map_html(attention: Attention, row: np.ndarray, look: AttentionLook, alt: str, key: str) -> str:
    """A small map: a token is a few whole pixels, over the frame that the panel's `--base` names."""
    grid = attention.grid
    row_at, column_at = divmod(grid.token_at(*look.query), grid.columns)
    marks = [marker((column_at + 0.5) / grid.columns, (row_at + 0.5) / grid.rows)]
    url = data_url(tokens_of(attention, row, look), is_lossless=True)
    classes = "et-map et-smooth" if look.is_smooth else "et-map"
    size = (grid.columns, grid.rows)
    return picture(url, alt, key=key, marks=marks, size=size, classes=classes)


def large_map(
    grid: TokenGrid,
    tokens: UInt8[np.ndarray, "rows columns 4"],
    values: Float[np.ndarray, " tokens"],
    base: str,
    alt: str,
    *,
    query: tuple[int, int] | None,
    unit: str = "× uniform",
    is_smooth: bool = False,
) -> str:
    """A map that fills its card, a cell a whole number of pixels; it carries its numbers for the pointer.

    A click chooses the pixel under it, on the border the nearest one of the sensor. `tokens` may have finer cells than
    the token grid; where there are too many of them the pointer is told none. Numbers travel as float32 in base64,
    which is as short as three digits of each and takes no time to write.
    """
    patch, (rows, columns) = patch_size(), tokens.shape[:2]
    width, height = grid.columns * patch, grid.rows * patch
    key = f"cut:{-grid.left},{-grid.top},{width},{height}"
    numbers = b64encode(values.astype("<f4").tobytes()).decode() if values.size <= MOST_NUMBERS else ""
    told = f' data-etv-map="{columns}" data-etv-values="{numbers}" data-etv-unit="{escape(unit)}"' if numbers else ""
    cross = asked = ""
    if query is not None:
        asked = f' data-etv-query="{query[0]},{query[1]}"'
        cross = marker((query[0] + grid.left + 0.5) / width, (query[1] + grid.top + 0.5) / height)
    return (
        f'<span class="et-picture et-pick et-map et-large-map{" et-smooth" if is_smooth else ""}"'
        f' style="--ratio:{grid.columns / grid.rows:.4f};--columns:{columns};--base:url({base})">'
        f'<img src="{data_url(tokens, is_lossless=True)}" alt="{escape(alt)}" width="{columns}"'
        f' height="{rows}" data-k="{key}" {ON_PICK} draggable="false"{told}{asked}>{cross}</span>'
    )


def map_legend(look: AttentionLook, highest: float = HIGHEST) -> str:
    """The colour scale in × uniform; an end at which colours are clipped says so."""
    title = "attention" if look.direction == "attends to" else "attention received"
    if look.map_range == "per map":
        low = "0" if look.is_linear else f"≤ {fraction(LOWEST)} ×"
        return legend(f"{title}, each map by its own range", css_gradient(sequential()), [(0, low), (1, "its maximum")])
    end = "≥ " if look.direction == "attends to" else ""
    if look.is_linear:
        ticks = [(value / HIGHEST, f"{fraction(highest * value / HIGHEST)} ×") for value in (0.0, 8.0, 16.0)]
        ticks = [(at, words if at else "0") for at, words in ticks]
    else:
        powers = float(np.log2(highest / LOWEST))
        inner = [value for value in (1.0, 4.0) if value < highest / 1.5]
        ticks = [(0.0, f"≤ {fraction(LOWEST)} ×")]
        ticks += [(float(np.log2(value / LOWEST)) / powers, f"{fraction(value)} ×") for value in inner]
    ticks.append((1.0, f"{end}{fraction(highest)} ×"))
    return legend(f"{title}, × uniform (1 × = all tokens alike)", css_gradient(sequential()), ticks)


def map_ends(look: AttentionLook) -> tuple[str, str]:
    """What the lowest and the highest colour of the maps stand for."""
    low = "0" if look.is_linear else fraction(LOWEST)
    if look.map_range == "per map":
        return low, "each map's maximum"
    if look.direction == "attended by":
        return f"{low} x", "each map's maximum, rounded up to a power of 2"
    return f"{low} x", f"{HIGHEST:g} x uniform"


def base_url(ready: Ready, attention: Attention, tones: Tones, pixels: int = BASE_PIXELS) -> str:
    """The dimmed frame under the maps, in its place on the padded token grid; `pixels` for each token's side."""
    grid = attention.grid

    def make() -> str:
        grey = on_grid(reconstruction_image(ready, tones), grid.rows, grid.columns, grid.top, grid.left, patch_size())
        step = max(1, patch_size() // pixels)
        rows, columns = grey.shape[0] // step, grey.shape[1] // step
        small = grey.reshape(rows, step, columns, step).mean((1, 3)).astype(np.uint8)
        return data_url(dimmed(small), is_lossless=False)

    return PICTURES.text(("base", ready.key, tones, pixels), make)


def patch_size() -> int:
    """Pixels on a token's side."""
    from etnet.nets.padding import PATCH  # needs torch, which is there once attention is

    return PATCH


def attention_image(ready: Ready, look: AttentionLook, site: str) -> UInt8[np.ndarray, "h w 3"] | None:
    """One map over the dimmed frame at sensor size, the query marked; `None` where this site was not probed."""
    if ready.attention is None or site not in ready.attention.sites:
        return None
    row = row_of(ready, ready.attention, site, look)
    return ARRAYS.get(
        ("attention image", ready.key, look, site), lambda: over_frame(ready, look, row, look.query), _nbytes
    )


def places_html(ready: Ready | None, look: AttentionLook | None, site: str) -> str:
    """One map alone, large, for those who do not ask for more; says what to do when there is nothing to show."""
    attention = None if ready is None else ready.attention
    if look is None:
        return panel("places", empty("Touch a picture", "Then this shows what the network attends to at that pixel."))
    if ready is None or attention is None or site not in attention.sites:
        return panel("places", empty("One moment", "It is computed together with the next image."))

    def make() -> str:
        image = attention_image(ready, look, site)
        assert image is not None
        height, width = ready.frame.shape
        name = f"What pixel {look.query} attends to"
        shown = picture(data_url(image, is_lossless=False), name, key="pixel", size=(width, height))
        words = site_words(site, attention.sites)
        return f'{shown}<div class="et-note">{escape(words)}</div>'

    return panel("places", PICTURES.text(("places", ready.key, look, site), make))


def _nbytes(array: np.ndarray) -> int:
    return array.nbytes
