"""Line charts as plain SVG: panels under each other, a labelled line each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

WIDTH, HEIGHT = 860, 240
LEFT, RIGHT, TOP, BOTTOM = 60, 200, 34, 36
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's, which the colour-blind can tell apart."""


@dataclass(frozen=True)
class Line:
    """`y` against `x`, of one length; values of `y` that are not finite are left out."""

    label: str
    x: np.ndarray
    y: np.ndarray
    colour: int = 0
    """Which of `COLOURS`, and the line's row in the legend."""


@dataclass(frozen=True)
class Panel:
    """Lines over one pair of axes that begin at 0."""

    title: str
    lines: Sequence[Line]
    unit: str
    """Of x, written behind its numbers."""
    marks: Sequence[tuple[float, str]] = ()
    """Places on the x axis with a word each."""
    length: float = 0.0
    """The x axis goes at least so far."""


def draw(panels: Sequence[Panel]) -> str:
    """An SVG of the panels, each 860 × 240."""
    height = HEIGHT * len(panels)
    box = f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="13"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {box}>'
    drawn = [_panel(panel, i * HEIGHT) for i, panel in enumerate(panels)]
    return "\n".join([head, f'<rect width="{WIDTH}" height="{height}" fill="white"/>', *drawn, "</svg>\n"])


def _panel(panel: Panel, top: int) -> str:
    highest = float(np.nanmax(np.concatenate([line.y for line in panel.lines]))) * 1.05 or 1.0
    longest = max(panel.length, *(float(line.x[-1]) for line in panel.lines)) or 1.0
    right, bottom = WIDTH - RIGHT, top + HEIGHT - BOTTOM

    def x(value: float) -> float:
        return LEFT + (right - LEFT) * value / longest

    def y(value: float) -> float:
        return bottom - (HEIGHT - TOP - BOTTOM) * value / highest

    parts = [f'<text x="{LEFT}" y="{top + 20}" font-weight="bold">{escape(panel.title)}</text>']
    for share in (0.0, 0.5, 1.0):
        value, along = highest * share, longest * share
        parts.append(f'<path d="M{LEFT} {y(value):.1f}H{right}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.3g}</text>')
        parts.append(f'<text x="{x(along):.1f}" y="{bottom + 18}" text-anchor="middle">{along:.4g} {panel.unit}</text>')
    for place, word in panel.marks:
        parts.append(f'<path d="M{x(place):.1f} {top + TOP}V{bottom}" stroke="#999" stroke-dasharray="3 3"/>')
        parts.append(f'<text x="{x(place) + 4:.1f}" y="{bottom - 6}" fill="#666">{escape(word)}</text>')
    for line in panel.lines:
        pairs = zip(line.x, line.y, strict=True)
        points = " ".join(f"{x(along):.1f},{y(value):.1f}" for along, value in pairs if np.isfinite(value))
        colour = COLOURS[line.colour % len(COLOURS)]
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        row = top + TOP + 18 * line.colour + 10
        parts.append(f'<text x="{right + 10}" y="{row}" fill="{colour}">{escape(line.label)}</text>')
    return "\n".join(parts)
