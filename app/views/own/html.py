"""What a view of one's own returned, as HTML; and what went wrong in it, by file and line."""

from __future__ import annotations

import traceback
from collections.abc import Mapping

import numpy as np

from app.html.elements import escape, panel, picture
from app.html.units import short
from app.views.own.values import Html, Plot, Table
from etnet.render.encode import data_url

LONGEST = 200_000
"""Characters of HTML or text."""
MOST_ROWS = 200
_COLOURS = ("#ffffff", "#b9b5ff", "#86e3b0", "#ffd685", "#eba6d2", "#8fd3ff")
_WIDTH, _HEIGHT = 320, 120


def own_html(value: object) -> str:
    """An array as an image, a mapping as a table of names and numbers, curves, a table, HTML, or text.

    Raises:
        TypeError: anything else.
    """
    match value:
        case Html(content):
            return panel("own", content[:LONGEST])
        case Plot():
            return panel("own", _plot(value))
        case Table():
            return panel("own", _table(value.heads, value.rows))
        case Mapping():
            return panel("own", _table(("", ""), list(value.items())))
        case str():
            return panel("own", f"<div>{escape(value[:LONGEST])}</div>")
        case None:
            return panel("own", '<div class="et-note">Nothing to show for this window.</div>')
    array = np.asarray(value)
    if array.dtype == object or array.ndim not in (2, 3):
        raise TypeError(
            f"show() returned {type(value).__name__}; wanted an image (h×w or h×w×3), "
            "a dict, a str, Plot, Table or Html"
        )
    return panel("own", _image(array))


def error_html(error: BaseException, path: str) -> str:
    """One line with the user's file and line."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == path]
    where = f", line {frames[-1].lineno}" if frames else ""
    name = path.replace("\\", "/").rsplit("/", 1)[-1]
    said = f"{name}{where}: {type(error).__name__}: {error}"
    code = f'<div class="et-note"><code>{escape(frames[-1].line or "")}</code></div>' if frames else ""
    return panel("own", f'<div class="et-failed" role="alert" data-testid="own-failed">{escape(said)}</div>{code}')


def _image(array: np.ndarray) -> str:
    if array.dtype != np.uint8:
        array = (np.nan_to_num(np.clip(array.astype(np.float32), 0, 1)) * 255).astype(np.uint8)
    if array.ndim == 3 and array.shape[2] not in (1, 3):
        raise TypeError(f"an image has 1 or 3 channels; this one has the shape {array.shape}")
    image = array[..., 0] if array.ndim == 3 and array.shape[2] == 1 else array
    height, width = image.shape[:2]
    return picture(
        data_url(np.ascontiguousarray(image), is_lossless=True), "own view", key="pixel", size=(width, height)
    )


def _table(heads: object, rows: object) -> str:
    cells = lambda row, tag: "".join(f"<{tag}>{escape(_cell(cell))}</{tag}>" for cell in row)  # noqa: E731
    body = "".join(f"<tr>{cells(row, 'td')}</tr>" for row in list(rows)[:MOST_ROWS])  # pyright: ignore[reportArgumentType]
    return f'<table class="et-means"><tr>{cells(heads, "th")}</tr>{body}</table>'


def _cell(cell: object) -> str:
    return short(float(cell)) if isinstance(cell, float | np.floating) else str(cell)[:300]


def _plot(plot: Plot) -> str:
    lines = {str(name): np.asarray(values, np.float64).ravel() for name, values in plot.lines.items()}
    known = np.concatenate([values[np.isfinite(values)] for values in lines.values()]) if lines else np.empty(0)
    if not len(known):
        return '<div class="et-note">No finite values to plot.</div>'
    low, high = float(known.min()), float(known.max())
    room = (high - low) or 1.0
    longest = max(map(len, lines.values()))
    x = np.arange(longest) if plot.x is None else np.asarray(plot.x, np.float64).ravel()[:longest]
    across = (x - x.min()) / ((x.max() - x.min()) or 1.0) * _WIDTH if len(x) else x
    drawn, names = "", ""
    for (name, values), colour in zip(lines.items(), _COLOURS * 9, strict=False):
        points = " ".join(
            f"{a:.1f},{_HEIGHT * (1 - (v - low) / room):.1f}"
            for a, v in zip(across, values, strict=False)
            if np.isfinite(v)
        )
        drawn += (
            f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"'
            ' vector-effect="non-scaling-stroke"></polyline>'
        )
        names += f'<span class="et-swatch"><i style="background:{colour}"></i>{escape(name)}</span>'
    return (
        f'<div class="et-swatches">{names}</div><div class="et-curve"><span>{short(high)}</span>'
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" preserveAspectRatio="none">{drawn}</svg>'
        f"<span>{short(low)} {escape(plot.x_label)}</span></div>"
    )
