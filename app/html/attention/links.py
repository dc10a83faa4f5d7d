"""The strongest looks of the query token, scale by scale, as what a scene draws and a legend says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.engine.requests import Ready
from app.html.moment import ARRAYS
from app.html.units import resolution, significant
from etnet.render.colours import Colour

if TYPE_CHECKING:
    from etnet.inspection.links import Link

NUM_LINKS = 6
"""At each scale."""
_LINK_BYTES = 300
"""What one link occupies with its numbers, measured."""
LINK_COLOURS: dict[int, Colour] = {0: (255, 255, 255), 1: (250, 248, 180), 2: (130, 212, 92), 3: (214, 132, 224)}
"""By scale; none of them is a hue of polarity."""


def links_of(ready: Ready | None, query: tuple[int, int] | None) -> tuple[Link, ...]:
    """The strongest looks from a pixel's token; none where there is no attention."""
    attention = ready.attention if ready is not None else None
    if ready is None or query is None or attention is None or not attention.sites:
        return ()
    token = attention.grid.token_at(*query)

    def make() -> tuple[Link, ...]:
        from etnet.inspection.links import strongest_links

        return strongest_links(attention, token, NUM_LINKS)

    return ARRAYS.get(("links", ready.key, token), make, lambda links: _LINK_BYTES * len(links))


def link_words(links: tuple[Link, ...], scale: int) -> str:
    """ "1/8 attends up to 3.1 × uniform"."""
    most = max((link.times_uniform for link in links if link.scale == scale), default=0.0)
    return f"{resolution(scale)} attends up to {significant(most, 2)} × uniform"
