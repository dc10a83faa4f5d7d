"""What is known of each run over time, and which frames all of them have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64, Int64

from app.views.compare.html.run import RunShown
from app.views.compare.state import Measure

if TYPE_CHECKING:
    from app.engine.jobs import JobResult
    from app.views.compare.jobs.scores import StripScores
    from etnet.evaluation.scores import Scores

TITLES: dict[Measure, str] = {
    "lpips": "LPIPS",
    "mse": "MSE",
    "ssim": "SSIM",
    "temporal": "Temporal consistency",
    "sharpness": "Sharpness",
    "contrast": "Contrast",
    "rate": "Event rate",
    "density": "Events per pixel",
}
ARROWS: dict[Measure, str] = {"lpips": "↓", "mse": "↓", "ssim": "↑", "temporal": "↓"}
"""Which way is better; the others have no better."""
BETTER_HIGH: tuple[Measure, ...] = ("ssim", "sharpness", "contrast")
_NONE = np.empty(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """What is known of one run over time. `frames` and `lags` as in `StripScores`; `share` 0 … 1."""

    run: RunShown
    stamps: Int64[np.ndarray, " n"] = field(default_factory=lambda: _NONE)
    frames: Int64[np.ndarray, " n"] = field(default_factory=lambda: _NONE)
    """Camera frames by number; −1 where there is no camera."""
    values: Mapping[str, Float64[np.ndarray, " n"]] = field(default_factory=dict)
    lags: Int64[np.ndarray, " n"] = field(default_factory=lambda: _NONE)
    share: float = 0.0
    num_wanted: int = 0
    trouble: str = ""
    is_sparse: bool = False
    remarks: tuple[str, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether nothing more will come."""
        return self.share >= 1 or bool(self.trouble)

    @property
    def keys(self) -> Int64[np.ndarray, " n"]:
        """What tells a frame from every other in all runs: its camera frame, else the stamp (µs) it ends with."""
        return np.where(self.frames >= 0, self.frames, self.stamps)

    def column(self, measure: str) -> Float64[np.ndarray, " n"]:
        """A measure's values; NaN where it has none."""
        return self.values.get(measure, np.full(len(self.stamps), np.nan))


def series_of(run: RunShown, result: JobResult | None) -> Series:
    """A run with what a job has found out; empty before it has."""
    if result is None or result.value is None:
        return Series(run, trouble=run.trouble or (result.trouble if result else ""))
    if run.run.replays:
        scores: Scores = result.value
        values = {str(name): column for name, column in scores.rows["as it is"].items()}
        return Series(
            run,
            scores.stamps,
            np.arange(len(scores.stamps), dtype=np.int64),
            values,
            np.zeros(len(scores.stamps), np.int64),
            result.share,
            round(len(scores.stamps) / result.share) if result.share else 0,
            result.trouble,
            remarks=scores.remarks,
        )
    strip: StripScores = result.value
    return Series(
        run,
        strip.stamps,
        strip.frames,
        strip.values,
        strip.lags,
        result.share,
        strip.num_wanted,
        result.trouble,
        strip.is_sparse,
    )


def common_keys(series: Sequence[Series]) -> Int64[np.ndarray, " n"]:
    """The frames that all runs have; of runs that cannot be scored nothing is asked."""
    known = [each.keys for each in series if not each.trouble]
    if not known:
        return _NONE
    found = known[0]
    for keys in known[1:]:
        found = np.intersect1d(found, keys)
    return found


def within(each: Series, start: int | None, stop: int | None) -> Series:
    """A series between two stamps (µs) alone, with the frames that `windows_between` has; `None` is open."""
    if start is None and stop is None:
        return each
    low = np.iinfo(np.int64).min if start is None else start  # the end of the window before the first
    high = np.iinfo(np.int64).max if stop is None else stop
    keeps = (each.stamps > low) & (each.stamps <= high)
    return Series(
        each.run,
        each.stamps[keeps],
        each.frames[keeps],
        {name: column[keeps] for name, column in each.values.items()},
        each.lags[keeps],
        each.share,
        each.num_wanted,
        each.trouble,
        each.is_sparse,
        each.remarks,
    )


def mean_over(each: Series, measure: str, keys: Int64[np.ndarray, " n"]) -> float:
    """A run's mean of a measure over some frames; NaN where none of them has it."""
    column = each.column(measure)[np.isin(each.keys, keys)]
    return float(np.nanmean(column)) if np.isfinite(column).any() else float("nan")


def worst_of(each: Series, measure: Measure, most: int) -> list[int]:
    """Places of a run's worst frames by a measure, the worst first."""
    column = each.column(measure)
    badness = np.where(np.isfinite(column), -column if measure in BETTER_HIGH else column, -np.inf)
    return [i for i in np.argsort(-badness, kind="stable")[:most].tolist() if np.isfinite(badness[i])]


def decimals(value: float) -> str:
    """As the tables print it: .0190, .642."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.4f}" if abs(value) < 0.1 else f"{value:.3f}"
