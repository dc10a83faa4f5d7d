"""What the network is given: the exact tensor with its border of zeros, the clicked pixel's part of it, the tokens."""

from __future__ import annotations

import numpy as np

from app.html.controls import choose_pixel
from app.html.elements import escape, legend, marker, panel, picture
from app.html.moment import PICTURES, Moment
from app.html.units import bin_words, count, milliseconds, short
from app.views.inspect.results import Given
from etnet.render.colours import OFF, ON, css_gradient, diverge, diverging, hexadecimal
from etnet.render.encode import data_url
from etnet.render.voxels import signed_max_pool

WIDTH = 200
"""Pixels of a bin's picture."""
MOST_TICKS = 300
"""Events of a pixel that are drawn; of more, every k-th."""
_BORDER = (62, 68, 78)


def given_html(given: Given, key: object, moment: Moment, query: tuple[int, int] | None, is_edited: bool) -> str:
    """Bins, then the pixel's profile and raster, then its token."""
    lead = (
        f"{len(given.padded)} bins of {given.padded.shape[2]} × {given.padded.shape[1]} numbers, the grey border "
        "included: zeros that make both sides divisible by 8. Each event adds +1 (brighter) or −1 (darker) to the "
        "two bins nearest in time."
    )
    how = "normalised, as this network expects" if given.is_normalised else "not normalised"
    parts = [
        f'<div class="et-note">{escape(lead)}</div>',
        PICTURES.text(("given", key), lambda: _bins(given)),
        _scale(given, f"polarity sum, {how}"),
    ]
    if query is None:
        parts.append(choose_pixel("Its five numbers and its events then stand here."))
    else:
        parts.append(_profile(given, query))
        if is_edited:
            parts.append(
                '<div class="et-note">The events of the pixel are shown as recorded, before your change.</div>'
            )
        parts.append(_raster(moment, query))
        parts.append(_token(given, moment, query))
    return panel("given", *parts)


def _bins(given: Given) -> str:
    factor = max(1, round(given.padded.shape[2] / WIDTH))
    limit = given.limit or 1.0
    tiles: list[str] = []
    pooled = signed_max_pool(given.padded, factor)
    for index, values in enumerate(pooled):
        tile = diverge(values, limit)
        above, below, left, right = (-(-border // factor) for border in given.borders)
        height, width = tile.shape[:2]
        tile[:above], tile[height - below :], tile[:, :left], tile[:, width - right :] = (_BORDER,) * 4
        area = (-given.borders[2], -given.borders[0], width * factor, height * factor)
        image = picture(data_url(tile, is_lossless=True), f"bin {index}", size=(width, height), area=area)
        tiles.append(f'<div class="et-thumb">{image}<span class="et-label">{bin_words(index)}</span></div>')
    return f'<div class="et-three">{"".join(tiles)}</div><div class="et-note">Bin position in the window</div>'


def _scale(given: Given, title: str) -> str:
    limit = given.limit or 1.0
    ticks = [(0.0, f"≤ −{short(limit)}"), (0.5, "0"), (1.0, f"≥ +{short(limit)}")]
    return legend(title, css_gradient(diverging()), ticks)


def _profile(given: Given, query: tuple[int, int]) -> str:
    values = given.padded[:, query[1] + given.borders[0], query[0] + given.borders[2]]
    limit = max(float(np.abs(values).max()), 1e-9)
    columns = []
    for index, value in enumerate(values.tolist()):
        share = 46 * abs(value) / limit
        side = f"bottom:50%;height:{share:.1f}%" if value > 0 else f"top:50%;height:{share:.1f}%"
        hue = hexadecimal(ON if value > 0 else OFF)
        number = "0" if value == 0 else f"{value:+.2f}".replace("-", "−")
        columns.append(
            f'<div class="et-column"><div><i style="{side};background:{hue}"></i><u></u></div><b>{number}</b>'
            f"<span>{bin_words(index)}</span></div>"
        )
    return (
        f"<h4>Pixel ({query[0]}, {query[1]}) in the five bins</h4>"
        f'<div class="et-columns" data-testid="profile">{"".join(columns)}</div>'
    )


def _raster(moment: Moment, query: tuple[int, int]) -> str:
    """The pixel's events on the window's time, one tick each: up brighter, down darker."""
    events, window = moment.events, moment.window
    here = (events.x == query[0]) & (events.y == query[1])
    span = max(window.t_stop - window.t_start, 1)
    places, signs = (events.t[here] - window.t_start) / span * 1000, events.p[here]
    num = len(places)
    step = -(-num // MOST_TICKS) or 1
    ticks = "".join(_tick(float(x), int(p)) for x, p in zip(places[::step], signs[::step], strict=True))
    said = "no event here" if num == 0 else f"{count(num)} event{'s' if num > 1 else ''} here"
    return (
        '<div class="et-raster" data-testid="raster"><svg viewBox="0 0 1000 40" preserveAspectRatio="none">'
        '<line x1="0" x2="1000" y1="20" y2="20" stroke="#ffffff55" vector-effect="non-scaling-stroke"></line>'
        f'{ticks}</svg></div><div class="et-caption"><span>window begins</span><span>{said}</span>'
        f"<span>ends, {milliseconds(span / 1000)} later</span></div>"
    )


def _tick(x: float, sign: int) -> str:
    end, hue = (2, ON) if sign > 0 else (38, OFF)
    return (
        f'<line x1="{x:.1f}" x2="{x:.1f}" y1="20" y2="{end}" stroke="{hexadecimal(hue)}" stroke-width="2.5"'
        ' vector-effect="non-scaling-stroke"></line>'
    )


def _token(given: Given, moment: Moment, query: tuple[int, int]) -> str:
    rows, columns = given.padded.shape[1] // 8, given.padded.shape[2] // 8
    row, column = (query[1] + given.borders[0]) // 8, (query[0] + given.borders[2]) // 8
    size = (columns, rows)
    tokens = np.full((rows, columns, 3), (40, 46, 54), np.uint8)
    if given.seen is not None:
        tokens[given.seen] = (40, 96, 86)
    image = picture(
        data_url(tokens, is_lossless=True),
        "the token grid",
        size=size,
        classes="et-sharp et-token-grid",
        marks=[marker((column + 0.5) / columns, (row + 0.5) / rows)],
        style=f"--columns:{columns};--rows:{rows}",
    )
    said = f"token {row * columns + column} of {count(rows * columns)} (row {row}, column {column}), 8 × 8 pixels."
    trained = given.seen_source
    if given.seen is not None:
        met = "was met" if given.seen[row, column] else "was never met"
        num_met = count(int(given.seen.sum()))
        trained = f"Its position {met} in training; green ones were, {num_met} in all ({given.seen_source})."
    return f'<h4>Its token</h4>{image}<div class="et-note" data-testid="token">{escape(said)} {escape(trained)}</div>'
