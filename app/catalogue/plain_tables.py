"""Triggers and motion samples beside a recording that was opened apart, as bare rows: no header that could lie."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from etnet.events.recording import Inertial
from etnet.events.triggers import Triggers

_TRIGGER = np.dtype([("t", "<i8"), ("channel", "<i2"), ("edge", "i1")])
_SAMPLE = np.dtype([("t", "<i8"), ("acceleration", "<f4", 3), ("rotation", "<f4", 3)])
LARGEST = 256 << 20
"""Bytes of one table that is read back."""


def write_tables(triggers: Triggers | None, inertial: Inertial | None, recording: Path) -> None:
    """Write them beside the file `recording`, those that are there."""
    if triggers is not None:
        rows = np.zeros(len(triggers), _TRIGGER)
        rows["t"], rows["channel"], rows["edge"] = triggers.stamps, triggers.channels, triggers.edges
        _beside(recording, "triggers").write_bytes(rows.tobytes())
    if inertial is not None:
        rows = np.zeros(len(inertial), _SAMPLE)
        rows["t"], rows["acceleration"], rows["rotation"] = inertial.stamps, inertial.acceleration, inertial.rotation
        _beside(recording, "motion").write_bytes(rows.tobytes())


def read_tables(recording: Path) -> tuple[Triggers | None, Inertial | None]:
    """What lies beside the file `recording`. What is no ascending table of the kind is left out."""
    pulses, samples = _rows(_beside(recording, "triggers"), _TRIGGER), _rows(_beside(recording, "motion"), _SAMPLE)
    triggers = inertial = None
    if pulses is not None and np.isin(pulses["edge"], (-1, 0, 1)).all():
        triggers = Triggers(*(np.ascontiguousarray(pulses[name]) for name in ("t", "channel", "edge")))
    if samples is not None and all(np.isfinite(samples[name]).all() for name in ("acceleration", "rotation")):
        inertial = Inertial(*(np.ascontiguousarray(samples[name]) for name in ("t", "acceleration", "rotation")))
    return triggers, inertial


def _rows(path: Path, kind: np.dtype) -> Shaped[np.ndarray, " n"] | None:
    if not path.is_file() or not 0 <= path.stat().st_size <= LARGEST or path.stat().st_size % kind.itemsize:
        return None
    rows = np.frombuffer(path.read_bytes(), kind)
    return rows if (np.diff(rows["t"]) >= 0).all() else None


def _beside(recording: Path, what: str) -> Path:
    return recording.with_suffix(f".{what}")
