"""A run's curves as a picture: the parts of its loss, and validation LPIPS with and without what TPA does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from etnet.render.chart import Line, Panel, draw
from etnet.training.config import TrainingError
from etnet.training.log import LOG, read_log

PARTS = {
    "perceptual": "LPIPS",
    "l1": "L1",
    "gradient": "gradient L1",
    "tone": "tone",
    "context": "read from TPA",
    "temporal": "temporal",
}
"""Entries of a log's "train" lines, unweighted, and what they are called in the picture."""

SMOOTHED = 5
"""Log lines in the running mean: neighbouring updates see other clips, and differ by more than a run gains."""


def plot_runs(folders: Sequence[Path]) -> str:
    """An SVG of the logs of one or more runs, each of which went on with the weights of the one before.

    Raises:
        TrainingError: a folder has no log of an update.
    """
    start, train, validation, marks = 0, [], [], []
    for folder in folders:
        lines = read_log(folder)
        losses = [line for line in lines if line["kind"] == "train"]
        if not losses:
            raise TrainingError(f"{folder / LOG}: no log of an update; give a run's folder")
        marks.append((float(start), folder.name))
        train += [_moved(line, start) for line in losses]
        validation += [_moved(line, start) for line in lines if line["kind"] == "validation"]
        start += losses[-1]["update"]
    marks = marks if len(folders) > 1 else []
    panels = [Panel("Loss on training clips, running mean", _losses(train), "updates", marks, start)]
    if len(validation) > 1:
        panels.append(Panel("LPIPS on held-out clips", _conditions(validation), "updates", marks, start))
    return draw(panels)


def _moved(line: Mapping[str, Any], updates: int) -> dict[str, Any]:
    return {**line, "update": line["update"] + updates}


def _losses(lines: Sequence[Mapping[str, Any]]) -> list[Line]:
    updates = np.array([line["update"] for line in lines])
    columns = {title: np.array([line.get(name, 0.0) for line in lines]) for name, title in PARTS.items()}
    used = [(title, column) for title, column in columns.items() if column.any()]
    return [Line(title, updates, _running_mean(column), i) for i, (title, column) in enumerate(used)]


def _running_mean(values: np.ndarray) -> np.ndarray:
    sums = np.cumsum(np.pad(values, (SMOOTHED, 0)))
    counts = np.minimum(np.arange(1, len(values) + 1), SMOOTHED)
    return (sums[SMOOTHED:] - sums[:-SMOOTHED]) / counts


def _conditions(lines: Sequence[Mapping[str, Any]]) -> list[Line]:
    updates = np.array([line["update"] for line in lines])
    names = list(lines[0]["lpips"])
    columns = [np.array([line["lpips"][name] for line in lines]) for name in names]
    return [
        Line(name.replace("_", " "), updates, column, i)
        for i, (name, column) in enumerate(zip(names, columns, strict=True))
    ]
