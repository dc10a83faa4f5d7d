"""What an evaluation found out, frame by frame, and its form on disk."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64, Int64

from etnet.errors import RecordingError
from etnet.evaluation.bootstrap import Averaging, average
from etnet.evaluation.datasets import Sequence
from etnet.evaluation.protocol import ProtocolName
from etnet.files import write_atomically
from etnet.plain_values import PlainError, bounded_json

Row = Literal["as it is", "best affine per frame", "constant grey"]
ROWS: tuple[Row, ...] = ("as it is", "best affine per frame", "constant grey")
"""What is scored of each recording: the model's frames, the same with the best gain and offset, the mean grey."""

Measure = Literal["mse", "ssim", "lpips", "lpips_vgg", "temporal", "sharpness", "contrast"]
TITLES: dict[Measure, str] = {
    "mse": "MSE ↓",
    "ssim": "SSIM ↑",
    "lpips": "LPIPS ↓",
    "lpips_vgg": "LPIPS-VGG ↓",
    "temporal": "TC ↓",
    "sharpness": "sharpness",
    "contrast": "contrast",
}
"""Measures in the order of the tables. An arrow says which way is better; the last two have no better."""

Columns = Mapping[Measure, Float64[np.ndarray, " n"]]
FORMAT = 1
LONGEST = 256 << 20
"""Bytes of one recording's scores that are read: of a million frames."""


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """One model on one recording under one protocol. NaN marks a frame for which a measure has no value."""

    model: str
    recording: str
    protocol: ProtocolName
    sequence: Sequence | None
    """The test sequence that the recording is, when it is a known one and was cut like it."""
    stamps: Int64[np.ndarray, " n"]
    """Of the scored frames, µs on the recording's clock."""
    rows: Mapping[Row, Columns]
    remarks: tuple[str, ...]

    @property
    def num_frames(self) -> int:
        """How many frames were scored."""
        return len(self.stamps)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """The measures that were taken, in the order of the tables."""
        return tuple(measure for measure in TITLES if measure in self.rows["as it is"])

    def mean(self, measure: Measure, row: Row = "as it is") -> float:
        """The mean over this recording's frames."""
        return average_of([self], measure, row, "sequences")

    def to_json(self) -> dict[str, Any]:
        """Plain values; NaN becomes null."""
        return {
            "format": FORMAT,
            "model": self.model,
            "recording": self.recording,
            "protocol": self.protocol,
            "sequence": list(self.sequence) if self.sequence else None,
            "stamps": self.stamps.tolist(),
            "rows": {
                row: {measure: [_or_none(v) for v in values.tolist()] for measure, values in columns.items()}
                for row, columns in self.rows.items()
            },
            "remarks": list(self.remarks),
        }

    @staticmethod
    def from_json(entry: Mapping[str, Any]) -> Scores:
        """What `to_json` gave."""
        from etnet.evaluation.datasets import Cut

        sequence = entry["sequence"]
        if sequence is not None:
            dataset, name, cut = sequence
            sequence = Sequence(dataset, name, Cut(*cut) if cut else None)
        rows = {
            row: {measure: np.array(values, np.float64) for measure, values in columns.items()}
            for row, columns in entry["rows"].items()
        }
        stamps = np.array(entry["stamps"], np.int64)
        identity = (entry["model"], entry["recording"], entry["protocol"])
        return Scores(*identity, sequence, stamps, rows, tuple(entry["remarks"]))


def average_of(scores: list[Scores], measure: Measure, row: Row, averaging: Averaging) -> float:
    """A measure over several recordings; NaN where none of them has it."""
    return average([s.rows[row][measure] for s in scores if measure in s.rows[row]], averaging)


def write_scores(scores: Scores, path: Path, key: str) -> None:
    """Write atomically. `key` names all that the numbers depend on; `read_scores` asks for the same."""
    text = json.dumps({"key": key, **scores.to_json()}, ensure_ascii=False, allow_nan=False)
    write_atomically(path, text.encode())


def read_scores(path: Path, key: str | None = None) -> Scores | None:
    """Scores that were written under the same key, or any; None where there are none, or older ones of something else.

    Raises:
        RecordingError: what lies there are no scores.
    """
    if not path.exists():
        return None
    try:
        entry = bounded_json(path.read_bytes(), LONGEST)
        if not isinstance(entry, dict):
            raise PlainError(f"is a {type(entry).__name__}, wanted a JSON object")
        if (key is not None and entry.get("key") != key) or entry.get("format") != FORMAT:
            return None
        return Scores.from_json(entry)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        said = str(error).replace("\n", " ")[:200]
        raise RecordingError(f"{path.name}: scores cannot be read ({said}); delete the file") from error


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
