"""A camera's motion samples as they gather while a file is decoded."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Int64

from etnet.events.formats.base import Remarks
from etnet.events.recording import Inertial

MAX_SAMPLES = 1 << 22
"""An hour at 1 kHz; what comes after is counted and not kept."""


class InertialTable:
    """Samples in the file's order; `inertial` puts them in the order of time."""

    def __init__(self) -> None:
        self._parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.num_samples = 0

    def add(
        self,
        stamps: Int64[np.ndarray, " n"],
        acceleration: Float32[np.ndarray, "n 3"],
        rotation: Float32[np.ndarray, "n 3"],
    ) -> None:
        """µs, g and degrees a second."""
        if len(stamps) and self.num_samples < MAX_SAMPLES:
            self._parts.append((stamps, acceleration, rotation))
        self.num_samples += len(stamps)

    def inertial(self, remarks: Remarks) -> Inertial | None:
        """All of them, and what there is to say."""
        if not self._parts:
            return None
        stamps, acceleration, rotation = (np.concatenate(column) for column in zip(*self._parts, strict=True))
        order = np.argsort(stamps, kind="stable")
        remarks.detected(f"{self.num_samples} inertial samples")
        if self.num_samples > len(stamps):
            remarks.repaired(f"only the first {len(stamps)} inertial samples are kept")
        return Inertial(stamps[order], acceleration[order], rotation[order])
