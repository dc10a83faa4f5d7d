"""One picture of an evaluation: LPIPS over time, a panel a recording, a line a model."""

from __future__ import annotations

from collections.abc import Sequence

from etnet.evaluation.scores import TITLES, Measure, Scores
from etnet.render.chart import Line, Panel, draw


def plot_scores(scores: Sequence[Scores], measure: Measure = "lpips") -> str:
    """An SVG of `measure` against seconds from each recording's first scored frame."""
    models = list(dict.fromkeys(entry.model for entry in scores))
    recordings = list(dict.fromkeys(entry.recording for entry in scores))
    return draw(
        [
            Panel(
                f"{recording}: {TITLES[measure]}",
                [_line(entry, measure, models) for entry in scores if entry.recording == recording],
                "s",
            )
            for recording in recordings
        ]
    )


def _line(entry: Scores, measure: Measure, models: Sequence[str]) -> Line:
    seconds = (entry.stamps - entry.stamps[0]) / 1e6
    label = f"{entry.model} {entry.mean(measure):.3f}"
    return Line(label, seconds, entry.rows["as it is"][measure], models.index(entry.model))
