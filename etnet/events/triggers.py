"""Pulses on a camera's trigger inputs, beside its events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int8, Int16, Int64


@dataclass(frozen=True, slots=True, eq=False)
class Triggers:
    """Edges that a camera saw on its trigger inputs. `stamps` are µs on the events' clock, ascending."""

    stamps: Int64[np.ndarray, " n"]
    channels: Int16[np.ndarray, " n"]
    """The number of the input, as the file counts it."""
    edges: Int8[np.ndarray, " n"]
    """+1 rising, −1 falling, 0 where the file does not tell which (a pulse, or AEDAT 2.0)."""

    def __len__(self) -> int:
        return len(self.stamps)

    def chosen(self, channel: int | None = None, edge: int | None = None) -> Triggers:
        """Those of one input, or of one kind of edge."""
        fits = np.ones(len(self), bool)
        if channel is not None:
            fits &= self.channels == channel
        if edge is not None:
            fits &= self.edges == edge
        return Triggers(self.stamps[fits], self.channels[fits], self.edges[fits])
