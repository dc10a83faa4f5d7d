"""Scores of many models and recordings as a table, Markdown and JSON. What is missing is named, never left out."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from etnet.evaluation.bootstrap import Interval, block_bootstrap
from etnet.evaluation.datasets import DATASETS
from etnet.evaluation.protocol import PROTOCOLS, Protocol, ProtocolName
from etnet.evaluation.scores import ROWS, TITLES, Measure, Row, Scores, average_of

SEED = 0
"""Of the resampling, so that a report written twice is the same."""
DIGITS = 4
SHORT_TITLES: dict[Measure, str] = {
    "mse": "MSE↓",
    "ssim": "SSIM↑",
    "lpips": "LPIPS↓",
    "lpips_vgg": "VGG↓",
    "temporal": "TC↓",
}
"""The measures that have a better and a worse, as the terminal names them."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A pair that could not be scored, and why."""

    model: str
    recording: str
    reason: str


@dataclass(frozen=True, slots=True)
class Line:
    """One line of the table."""

    group: str
    """A recording, or a dataset's mean."""
    model: str
    """Empty on the line of the constant grey, which no model made."""
    row: Row
    num_frames: int
    values: dict[Measure, Interval]

    @property
    def label(self) -> str:
        """What is scored, in words."""
        return f"{self.model}, {self.row}" if self.model and self.row != "as it is" else self.model or self.row


@dataclass(frozen=True, slots=True)
class Report:
    """Everything that was scored under one protocol."""

    protocol: ProtocolName
    scores: tuple[Scores, ...]
    failures: tuple[Failure, ...] = ()

    @property
    def measures(self) -> tuple[Measure, ...]:
        """The measures that any of the scores has."""
        return tuple(measure for measure in TITLES if any(measure in scores.measures for scores in self.scores))

    def lines(self) -> list[Line]:
        """Recording by recording, then dataset by dataset: constant grey, then each model raw and affine."""
        lines: list[Line] = []
        for recording in _unique(scores.recording for scores in self.scores):
            lines += self._group(recording, [scores for scores in self.scores if scores.recording == recording])
        for dataset, sequences in DATASETS.items():
            found = [scores for scores in self.scores if scores.sequence and scores.sequence.dataset == dataset]
            scored = {scores.sequence.name for scores in found if scores.sequence}
            if scored:
                lines += self._group(f"{dataset} ({len(scored)} of {len(sequences)} sequences)", found)
        return lines

    def notes(self) -> list[str]:
        """What a reader must know beside the numbers."""
        protocol = PROTOCOLS[self.protocol]
        notes = [_describe(protocol)]
        notes += _unique(remark for scores in self.scores for remark in scores.remarks)
        if "lpips" in self.measures and "lpips_vgg" not in self.measures:
            from etnet.evaluation.judge import INSTALL

            notes.append(f"No second judge: LPIPS-VGG's weights are not installed ({INSTALL})")
        notes += [f"Failed: {failure.model} on {failure.recording}: {failure.reason}" for failure in self.failures]
        return notes + [f"Missing: {line}" for line in self.missing()]

    def missing(self) -> list[str]:
        """The test sequences of the field's three datasets that were not scored, by name."""
        scored = {scores.sequence[:2] for scores in self.scores if scores.sequence}
        lines = []
        for dataset, sequences in DATASETS.items():
            absent = [name for name in sequences if (dataset, name) not in scored]
            if absent:
                which = "all of it" if len(absent) == len(sequences) else ", ".join(absent)
                lines.append(f"{dataset}: {which}")
        return lines

    def to_table(self) -> Table:
        """For a terminal of 80 columns: no interval but that of LPIPS. The notes are not in it."""
        measures: list[Measure] = [measure for measure in SHORT_TITLES if measure in self.measures]
        table = Table(title=f"protocol {self.protocol}", box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
        table.add_column("", no_wrap=True)
        for title in ("frames", *(SHORT_TITLES[measure] for measure in measures), "LPIPS 95 %"):
            table.add_column(title, justify="right", no_wrap=True)
        before = None
        for line in self.lines():
            if line.group != before:
                if before is not None:
                    table.add_section()
                table.add_row(f"[bold]{escape(line.group)}[/bold]")
            before = line.group
            label = line.model if line.row == "as it is" else line.row
            numbers = [_short(line.values[measure].mean, measure) for measure in measures]
            bounds = [_short(bound, "lpips") for bound in line.values["lpips"][1:]]
            table.add_row(escape(label), str(line.num_frames), *numbers, "–".join(bounds))
        return table

    def to_markdown(self) -> str:
        """For a file that people read."""
        titles = ["", "scored", "frames", *(TITLES[measure] for measure in self.measures)]
        rows = [titles, ["---", "---", *["--:"] * (len(titles) - 2)]]
        for line in self.lines():
            cells = [_cell(line.values.get(measure), measure) for measure in self.measures]
            rows.append([line.group, line.label, str(line.num_frames), *cells])
        table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
        notes = "\n".join(f"- {note}" for note in self.notes())
        return f"# Scores, protocol `{self.protocol}`\n\n{table}\n\n{notes}\n"

    def to_json(self) -> dict[str, Any]:
        """Every line with its intervals, and every score frame by frame."""
        return {
            "protocol": self.protocol,
            "lines": [
                {
                    "group": line.group,
                    "model": line.model or None,
                    "row": line.row,
                    "frames": line.num_frames,
                    "values": {
                        measure: None if math.isnan(value.mean) else value._asdict()
                        for measure, value in line.values.items()
                    },
                }
                for line in self.lines()
            ],
            "scores": [scores.to_json() for scores in self.scores],
            "failures": [[failure.model, failure.recording, failure.reason] for failure in self.failures],
            "missing": self.missing(),
            "notes": self.notes(),
        }

    def _group(self, group: str, scores: Sequence[Scores]) -> list[Line]:
        models = _unique(entry.model for entry in scores)
        by_model = {model: [entry for entry in scores if entry.model == model] for model in models}
        lines = [self._line(group, "", "constant grey", by_model[models[0]])]
        for model, entries in by_model.items():
            lines += [self._line(group, model, row, entries) for row in ROWS if row != "constant grey"]
        return lines

    def _line(self, group: str, model: str, row: Row, scores: list[Scores]) -> Line:
        averaging = PROTOCOLS[self.protocol].averaging
        values = {}
        for measure in self.measures:
            columns = [entry.rows[row][measure] for entry in scores if measure in entry.rows[row]]
            interval = block_bootstrap(columns, np.random.default_rng(SEED), averaging)
            values[measure] = interval._replace(mean=average_of(scores, measure, row, averaging))
        return Line(group, model, row, sum(entry.num_frames for entry in scores), values)


def _cell(value: Interval | None, measure: Measure) -> str:
    """A mean; with its interval for the two judges, which decide."""
    if value is None or math.isnan(value.mean):
        return "n/a"
    if measure in ("lpips", "lpips_vgg"):
        return f"{value.mean:.{DIGITS}f} [{value.low:.3f}, {value.high:.3f}]"
    return f"{value.mean:.{DIGITS}f}"


def _short(value: float, measure: Measure) -> str:
    """As papers print it: no leading zero."""
    if math.isnan(value):
        return "n/a"
    return re.sub(r"^(-?)0\.", r"\1.", f"{value:.{4 if measure == 'mse' else 3}f}")


def _describe(protocol: Protocol) -> str:
    start = f"{protocol.warm_up / 1e6:g} s of warm-up" if protocol.warm_up else "cold start at the cut"
    ssim = f"SSIM {protocol.ssim.window} {protocol.ssim.side}×{protocol.ssim.side}, range {protocol.ssim.data_range:g}"
    clip = "clipped to 0 … 1" if protocol.clips else "not clipped"
    mean = "mean of the sequences' means" if protocol.averaging == "sequences" else "mean of all frames"
    return (
        f"Protocol {protocol.name}: windows between frames, {start}, {ssim}, predictions {clip}, {mean}; in brackets "
        "95 % block-bootstrap intervals over frames; differences below .01 LPIPS are no ranking"
    )


def _unique(names: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(names))
