"""What the network is given: the window cut into five time bins, as tiles."""

from __future__ import annotations

from app.html.elements import empty, escape, legend, panel, picture
from app.html.moment import NUM_BINS, PICTURES, Moment
from app.html.units import bin_words, short
from etnet.render.colours import css_gradient, diverging
from etnet.render.encode import Indexed, data_url
from etnet.render.voxels import pooled_by, voxel_levels, voxel_limit
from etnet.voxel import MIN_EVENTS

TILE_WIDTH = 120
"""Pixels of a small tile: sharp at 76 px on a screen of double density."""


def voxel_html(moment: Moment, opened: int | None = None) -> str:
    """Five bins in a row, or one of them large. Clicks send `bin:0` … `bin:4`, or `bin:` to go back."""
    opened = None if opened is None else min(max(opened, 0), NUM_BINS - 1)
    return PICTURES.text(("voxel", moment.key, opened), lambda: _voxel_html(moment, opened))


def _voxel_html(moment: Moment, opened: int | None) -> str:
    if moment.window.num_events < MIN_EVENTS:
        return panel(
            "voxels",
            empty("An empty grid", f"This window holds fewer than {MIN_EVENTS} events; the network is given zeros."),
        )
    limit = voxel_limit(moment.voxel)
    small = voxel_levels(moment.voxel, TILE_WIDTH, limit)
    factor = pooled_by(moment.voxel.shape[-1], TILE_WIDTH)
    tiles: list[str] = []
    for index, tile in enumerate(small):
        image = picture(
            data_url(Indexed(tile, diverging()), is_lossless=True),
            f"time bin {index}",
            key=f"set:voxels.voxel_bin:{index}",
            size=(tile.shape[1], tile.shape[0]),
            area=(0, 0, factor * tile.shape[1], factor * tile.shape[0]),
        )
        chosen = " et-chosen" if index == opened else ""
        tiles.append(f'<div class="et-thumb{chosen}">{image}<span class="et-label">{bin_words(index)}</span></div>')
    row = f'<div class="et-row" style="grid-template-columns:repeat({NUM_BINS},minmax(0,1fr))">{"".join(tiles)}</div>'
    scale = legend(
        "polarity sum: OFF … ON",
        css_gradient(diverging()),
        [(0.0, f"≤ −{short(limit)}"), (0.5, "0"), (1.0, f"≥ +{short(limit)}")],
    )
    parts = [row]
    if opened is not None:
        parts.append(_large(moment, opened, limit))
    else:
        parts.append('<div class="et-note">bin position in the window · click a tile to enlarge it</div>')
    return panel("voxels", *parts, scale)


def _large(moment: Moment, opened: int, limit: float) -> str:
    tile = voxel_levels(moment.voxel[opened : opened + 1], moment.recording.sensor.width, limit)
    image = picture(
        data_url(Indexed(tile[0], diverging()), is_lossless=True),
        f"time bin {opened}, large",
        key="set:voxels.voxel_bin:none",
        size=(tile.shape[2], tile.shape[1]),
    )
    back = " · click to close"
    caption = escape(f"around {bin_words(opened)} of the window{back}")
    return f'{image}<div class="et-caption"><span>{caption}</span></div>'
