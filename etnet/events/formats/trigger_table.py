"""Triggers as they gather while a file is decoded."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Int64, Integer, Shaped

from etnet.events.formats.base import Remarks
from etnet.events.triggers import Triggers

MOST_TRIGGERS = 1 << 22
"""An hour at 1 kHz; those after them are counted and not kept."""


@dataclass
class TriggerTable:
    """Triggers in the file's order; `triggers` puts them in the order of time."""

    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    num_triggers: int = 0

    def add(
        self,
        stamps: Integer[np.ndarray, " n"],
        channels: Shaped[np.ndarray, " n"] | int,
        edges: Shaped[np.ndarray, " n"] | int,
    ) -> None:
        """Stamps in µs, inputs, and edges as +1, −1 or 0; a number holds for all."""
        if len(stamps) and self.num_triggers < MOST_TRIGGERS:
            kept = np.asarray(stamps, np.int64)
            columns = np.broadcast_to(channels, kept.shape), np.broadcast_to(edges, kept.shape)
            self.parts.append((kept, columns[0].astype(np.int16), columns[1].astype(np.int8)))
        self.num_triggers += len(stamps)

    @property
    def rows(self) -> Int64[np.ndarray, "n 3"]:
        """Stamp, input and edge of each, in the file's order; another thread may go on adding."""
        return np.concatenate([np.empty((0, 3), np.int64), *(np.stack(part, 1) for part in tuple(self.parts))])

    def triggers(self, remarks: Remarks, offset: int = 0) -> Triggers | None:
        """All of them, `offset` (µs) later, and what there is to say."""
        if not self.parts:
            return None
        stamps, channels, edges = (np.concatenate(column) for column in zip(*self.parts, strict=True))
        order = np.argsort(stamps, kind="stable")
        triggers = Triggers(stamps[order] + offset, channels[order], edges[order])
        remarks.detected(counted(triggers))
        if self.num_triggers > len(triggers):
            remarks.repaired(f"only the first {len(triggers)} triggers are kept of {self.num_triggers}")
        return triggers


def counted(triggers: Triggers) -> str:
    """How many there are of each kind, in words."""
    rising, falling = np.count_nonzero(triggers.edges > 0), np.count_nonzero(triggers.edges < 0)
    unknown = len(triggers) - rising - falling
    kinds = [f"{num} {name}" for num, name in ((rising, "rising"), (falling, "falling"), (unknown, "unknown")) if num]
    inputs = ", ".join(str(number) for number in np.unique(triggers.channels)[:8])
    return f"{len(triggers)} triggers ({', '.join(kinds)}) on input {inputs}"
