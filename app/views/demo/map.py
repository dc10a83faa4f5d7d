"""Where the network looks, for everybody: one map, and a pointer that travels from the spot to what is looked at."""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from app.engine.requests import Ready
from app.html.attention.look import AttentionLook
from app.html.attention.maps import over_frame, row_of, site_in
from app.html.elements import empty, picture
from app.html.moment import PICTURES
from app.html.pictures import reconstruction_image
from app.views.attention.state import AttentionState, look_of
from app.views.page import Page
from etnet.render.attention import dimmed
from etnet.render.encode import data_url

if TYPE_CHECKING:
    from etnet.nets.attention import Attention

NUM_TARGETS = 4
"""Places the pointer travels to."""
APART = 3
"""Patches between two of them, at least: neighbours light up together."""
LEG = 1.7
"""Seconds for one way and a rest at its end."""
TRAVELS = 0.55
"""Share of a leg in which the pointer moves."""

Point = tuple[float, float]


def map_html(page: Page) -> str:
    """The map of the chosen spot, or what to do to get one."""
    look, ready = look_of(page), page.ready
    if look is None:
        return empty("Touch a picture", "Then this shows where the network looks to redraw that spot.")
    attention = None if ready is None else ready.attention
    site = page.state.of(AttentionState).site
    if ready is None:
        return empty("One moment", "It comes with the first image.")
    if attention is None or not attention.sites:
        return _waiting(ready, look)
    site = site_in(attention, site)

    def make() -> str:
        row = row_of(ready, attention, site, look)
        height, width = ready.frame.shape
        url = data_url(over_frame(ready, look, row, None), is_lossless=False)
        x, y = look.query
        spots = targets(attention, row, look.query)
        marks = [pointer_svg((x + 0.5, y + 0.5), spots, (width, height))]
        return picture(url, "Where the network looks", key="pixel", marks=marks, size=(width, height))

    return PICTURES.text(("demo map", ready.key, look, site), make)


def _waiting(ready: Ready, look: AttentionLook) -> str:
    """The image with the ringed spot alone, until the map has come."""
    height, width = ready.frame.shape
    x, y = look.query
    grey = reconstruction_image(ready, look.tones)
    url = PICTURES.text(("demo dimmed", ready.key, look.tones), lambda: data_url(dimmed(grey), is_lossless=False))
    marks = [pointer_svg((x + 0.5, y + 0.5), [], (width, height))]
    return picture(url, "The network looks", key="pixel", marks=marks, size=(width, height), classes="etv-looking")


def targets(attention: Attention, row: Float[np.ndarray, " tokens"], query: tuple[int, int]) -> list[Point]:
    """The middles (pixels) of the patches that are looked at most, apart from each other and from the spot."""
    grid = attention.grid
    taken = [divmod(grid.token_at(*query), grid.columns)]
    found: list[Point] = []
    for token in np.argsort(row)[::-1]:
        place = divmod(int(token), grid.columns)
        if all(max(abs(place[0] - other[0]), abs(place[1] - other[1])) >= APART for other in taken):
            taken.append(place)
            x, y = grid.pixel_of(int(token))
            found.append((x + 0.5, y + 0.5))
        if len(found) == NUM_TARGETS:
            break
    return found


def pointer_svg(spot: Point, places: list[Point], size: tuple[int, int]) -> str:
    """The ringed spot, lines to the places, and a dot that travels along them one after the other."""
    width, height = size
    unit = max(width, height) / 100
    ring = f'<circle cx="{spot[0]:.1f}" cy="{spot[1]:.1f}" r="{2.6 * unit:.2f}" class="etv-spot"/>'
    lines = "".join(
        f'<path d="M{spot[0]:.1f} {spot[1]:.1f}L{x:.1f} {y:.1f}"/><circle cx="{x:.1f}" cy="{y:.1f}" r="{unit:.2f}"/>'
        for x, y in places
    )
    dot = f'<circle r="{1.5 * unit:.2f}" class="etv-traveller">{_travel(spot, places)}</circle>' if places else ""
    return (
        f'<svg class="etv-pointer" viewBox="0 0 {width} {height}" preserveAspectRatio="none" aria-hidden="true">'
        f"{lines}{ring}{dot}</svg>"
    )


def _travel(spot: Point, places: list[Point]) -> str:
    """An animation along all the lines: there, a rest, and on from the spot again."""
    lengths = [float(np.hypot(x - spot[0], y - spot[1])) or 1.0 for x, y in places]
    ends = [share / sum(lengths) for share in accumulate(lengths)]
    points, times = [0.0], [0.0]
    for number, end in enumerate(ends):
        points += [end, end]
        times += [(number + TRAVELS) / len(ends), (number + 1) / len(ends)]
    path = "".join(f"M{spot[0]:.1f} {spot[1]:.1f}L{x:.1f} {y:.1f}" for x, y in places)
    return (
        f'<animateMotion dur="{LEG * len(places):.1f}s" repeatCount="indefinite" calcMode="linear" path="{path}"'
        f' keyPoints="{_listed(points)}" keyTimes="{_listed(times)}"/>'
    )


def _listed(numbers: list[float]) -> str:
    return ";".join(f"{min(number, 1.0):.4f}" for number in numbers)
