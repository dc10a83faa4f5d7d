"""Every head of every site as a dot: how sharp it looks by how far, as large as what it does when it is masked."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from app.html.controls import percent
from app.html.elements import ON_PICK, escape
from app.html.moment import ARRAYS
from app.html.units import resolution
from app.views.attention.html.shown import Shown

Effects = dict[str, Float[np.ndarray, " heads"]]
HUES = {1: "#b8b0ff", 2: "#7fd4c1", 3: "#f0d27a", 0: "#e08fb0"}
"""By scale; not those of polarity."""
SMALLEST, LARGEST = 3.0, 15.0
"""Of a dot's radius."""
_WIDTH, _HEIGHT, _LEFT, _BELOW = 700, 400, 44, 36


def dots_html(shown: Shown, effects: Effects) -> str:
    """A plot with a dot for each head; a click opens it. Before its effect is measured a dot is a small circle."""
    entropy, distance = table_of(shown)
    atlas = shown.result("atlas")
    image: Effects = {} if atlas is None else dict(zip(atlas.sites, atlas.on_image.numpy(), strict=True))
    largest = _largest(effects), _largest(image)
    bits, furthest = float(np.log2(shown.grid.num_tokens)), max(float(distance.max()) * 1.08, 1.0)
    dots: list[tuple[float, str]] = []
    for place, site in enumerate(shown.attention.sites):
        for head in range(shown.num_heads):
            sharp, far = float(entropy[place, head]), float(distance[place, head])
            x = _LEFT + (_WIDTH - _LEFT - 16) * far / furthest
            y = 12 + (_HEIGHT - _BELOW - 12) * (1 - sharp / bits)
            here, whole = _value(effects, site, head), _value(image, site, head)
            radius = _radius(here, largest[0])
            words = f"{site}, head {head}: {sharp:.2f} bits, {far:.0f} px; {_said(here, whole)}"
            is_chosen = (site, head) == (shown.site, shown.look.head)
            rings = f"{x:.1f}", f"{y:.1f}", radius, _radius(whole, largest[1]), not np.isnan(here)
            dots.append((-radius, _dot(site, head, words, *rings, is_chosen)))
    drawn = "".join(dot for _, dot in sorted(dots, key=lambda dot: dot[0]))  # small ones lie above large ones
    return f'<div class="et-dots"><svg viewBox="0 0 {_WIDTH} {_HEIGHT}">{_axes(bits, furthest)}{drawn}</svg></div>'


def _dot(
    site: str, head: int, words: str, x: str, y: str, radius: float, ring: float, is_measured: bool, is_chosen: bool
) -> str:
    hue, mark = HUES[int(site[5])], " et-chosen" if is_chosen else ""
    fill = 0.55 if is_measured else 0
    return (
        f'<g class="et-dot{mark}" data-k="attention:head:{site}:{head}" {ON_PICK} data-testid="dot">'
        f"<title>{escape(words)}</title>"
        f'<circle cx="{x}" cy="{y}" r="{ring:.1f}" fill="none" stroke="{hue}" opacity="0.5"/>'
        f'<circle cx="{x}" cy="{y}" r="{radius:.1f}" fill="{hue}" fill-opacity="{fill}" stroke="{hue}"/></g>'
    )


def table_of(shown: Shown) -> tuple[np.ndarray, np.ndarray]:
    """Entropy and distance of each site's heads from this token."""
    from etnet.inspection.atlas import head_table

    def make() -> tuple[np.ndarray, np.ndarray]:
        found = head_table(shown.attention, shown.token)
        return found.entropy.cpu().numpy(), found.distance.cpu().numpy()

    return ARRAYS.get(("head table", shown.ready.key, shown.token), make, lambda made: 2 * made[0].nbytes)


def _value(effects: Effects, site: str, head: int) -> float:
    row = effects.get(site)
    return float("nan") if row is None else float(row[head])


def _said(value: float, image: float) -> str:
    if np.isnan(value):
        return "not measured yet"
    return f"{percent(value)} at this pixel, {percent(image, is_signed=False)} of the image"


def _largest(effects: Effects) -> float:
    measured = [float(np.nanmax(np.abs(row))) for row in effects.values() if not np.isnan(row).all()]
    return max(measured, default=0.0)


def _radius(value: float, largest: float) -> float:
    """An area that grows with the effect."""
    share = 0.0 if np.isnan(value) or largest <= 0 else abs(value) / largest
    return SMALLEST + (LARGEST - SMALLEST) * share**0.5


def _axes(bits: float, furthest: float) -> str:
    bottom, right = _HEIGHT - _BELOW, _WIDTH - 16
    drawn = f'<path d="M{_LEFT} 8V{bottom}H{right}" fill="none" stroke="var(--line-strong)"/>'
    for each in range(0, int(bits) + 1, 2):
        y = 12 + (bottom - 12) * (1 - each / bits)
        drawn += f'<text x="{_LEFT - 8}" y="{y + 4:.0f}" text-anchor="end">{each}</text>'
    for each in range(0, int(furthest) + 1, max(5, 10 * round(furthest / 60))):
        drawn += f'<text x="{_LEFT + (right - _LEFT) * each / furthest:.0f}" y="{bottom + 16}">{each}</text>'
    drawn += f'<text x="{_LEFT + 8}" y="18">entropy, bits ({bits:.2f} is uniform)</text>'
    drawn += f'<text x="{right}" y="{bottom + 32}" text-anchor="end">mean distance, px</text>'
    for place, scale in enumerate((3, 2, 1)):
        at = _LEFT + 60 * place
        drawn += f'<circle cx="{at + 4}" cy="{bottom + 28}" r="4" fill="{HUES[scale]}"/>'
        drawn += f'<text x="{at + 12}" y="{bottom + 32}">{resolution(scale)}</text>'
    return drawn
