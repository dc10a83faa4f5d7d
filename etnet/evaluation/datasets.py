"""The test sequences of this field, and which part of each is scored (seconds from the start of the recording)."""

from __future__ import annotations

from typing import NamedTuple

from etnet.events.recording import Recording

DATA_SUFFIXES = ("_data", "_events")
"""What the datasets' own file names add to the sequence's name."""


class Cut(NamedTuple):
    """The scored part of a recording, seconds from its start."""

    start: float
    stop: float

    def __str__(self) -> str:
        return f"{self.start:g}–{self.stop:g} s"


DATASETS: dict[str, dict[str, Cut | None]] = {
    "IJRR": {
        **{f"{scene}_6dof": Cut(5, 20) for scene in ("boxes", "dynamic", "poster", "shapes")},
        "calibration": Cut(5, 20),
        "office_zigzag": Cut(5, 12),
        "slider_depth": Cut(1, 2.5),
    },
    "MVSEC": {
        **{f"indoor_flying{i}": Cut(10, 70) for i in (1, 2, 3)},
        "indoor_flying4": Cut(10, 19.8),
        "outdoor_day1": Cut(0, 60),
        "outdoor_day2": Cut(100, 160),
    },
    "HQF": dict.fromkeys(
        (
            "bike_bay_hdr", "boxes", "desk", "desk_fast", "desk_hand_only", "desk_slow", "engineering_posters",
            "high_texture_plants", "poster_pillar_1", "poster_pillar_2", "reflective_materials", "slow_and_fast_desk",
            "slow_hand", "still_life",
        )
    ),
}  # fmt: skip
"""Dataset → sequence → its cut; None scores the whole recording. The same in EVREAL's and V2V's scripts."""


class Sequence(NamedTuple):
    """A sequence that the tables of the field know."""

    dataset: str
    name: str
    cut: Cut | None


def sequence_called(name: str) -> Sequence | None:
    """The known sequence of this name ("slider_depth", "indoor_flying1_data"), without its file suffix; or None."""
    stem = name.split(".")[0].lower()
    for suffix in DATA_SUFFIXES:
        stem = stem.removesuffix(suffix)
    for dataset, sequences in DATASETS.items():
        if stem in sequences:
            return Sequence(dataset, stem, sequences[stem])
    return None


def start_of(recording: Recording) -> int:
    """Where a recording's seconds are counted from, µs: its first event or its first frame, whichever is earlier."""
    truth = recording.ground_truth
    if truth is None or len(truth) == 0:
        return recording.span.start
    return min(recording.span.start, int(truth.stamps[0]))
