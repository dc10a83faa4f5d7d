"""One picture of an evaluation: LPIPS over time, a panel a recording, a line a model. Plain SVG."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from etnet.evaluation.scores import TITLES, Measure, Scores

WIDTH, HEIGHT = 860, 240
LEFT, RIGHT, TOP, BOTTOM = 60, 200, 34, 36
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Okabe and Ito's, which the colour-blind can tell apart."""


def plot_scores(scores: Sequence[Scores], measure: Measure = "lpips") -> str:
    """An SVG of `measure` against seconds from each recording's first scored frame."""
    models = list(dict.fromkeys(entry.model for entry in scores))
    recordings = list(dict.fromkeys(entry.recording for entry in scores))
    panels = [
        _panel([entry for entry in scores if entry.recording == recording], models, measure, i * HEIGHT)
        for i, recording in enumerate(recordings)
    ]
    height = HEIGHT * len(recordings)
    box = f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="13"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {box}>'
    return "\n".join([head, f'<rect width="{WIDTH}" height="{height}" fill="white"/>', *panels, "</svg>\n"])


def _panel(scores: Sequence[Scores], models: Sequence[str], measure: Measure, top: int) -> str:
    values = np.concatenate([entry.rows["as it is"][measure] for entry in scores])
    highest = float(np.nanmax(values)) * 1.05 or 1.0
    seconds = max(float(entry.stamps[-1] - entry.stamps[0]) / 1e6 for entry in scores) or 1.0
    right, bottom = WIDTH - RIGHT, top + HEIGHT - BOTTOM

    def x(second: float) -> float:
        return LEFT + (right - LEFT) * second / seconds

    def y(value: float) -> float:
        return bottom - (HEIGHT - TOP - BOTTOM) * value / highest

    title = f"{escape(scores[0].recording)}: {TITLES[measure]}"
    parts = [f'<text x="{LEFT}" y="{top + 20}" font-weight="bold">{title}</text>']
    for share in (0.0, 0.5, 1.0):
        value, second = highest * share, seconds * share
        parts.append(f'<path d="M{LEFT} {y(value):.1f}H{right}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:.3g}</text>')
        parts.append(f'<text x="{x(second):.1f}" y="{bottom + 18}" text-anchor="middle">{second:.3g} s</text>')
    for entry in scores:
        place = models.index(entry.model)
        column = entry.rows["as it is"][measure]
        points = zip((entry.stamps - entry.stamps[0]) / 1e6, column, strict=True)
        line = " ".join(f"{x(second):.1f},{y(value):.1f}" for second, value in points if np.isfinite(value))
        colour = COLOURS[place % len(COLOURS)]
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
        label = f"{escape(entry.model)} {entry.mean(measure):.3f}"
        parts.append(f'<text x="{right + 10}" y="{top + TOP + 18 * place + 10}" fill="{colour}">{label}</text>')
    return "\n".join(parts)
