"""The window's events as a cloud of points, thinned evenly to what a browser can draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from app.html.moment import ARRAYS, Moment
from etnet.render.events import polarity_colours


@dataclass(frozen=True, slots=True, eq=False)
class EventCloud:
    """`positions`: pixel x and y (their middles), and age: 0 at the window's end (newest) … 1 at its start."""

    positions: Float32[np.ndarray, "n 3"]
    colours: UInt8[np.ndarray, "n 3"]
    num_events: int
    duration_ms: float
    is_traced: bool = False
    """Whether the colours say what a pixel owes to the events, and not their polarity."""

    @property
    def is_thinned(self) -> bool:
        """Whether some events are left out."""
        return len(self.positions) < self.num_events


def event_cloud(moment: Moment, limit: int) -> EventCloud:
    """At most `limit` points: every k-th event, so that density over time and place is kept."""
    return ARRAYS.get(
        ("cloud", moment.key, limit), lambda: _cloud(moment, limit), lambda made: 15 * len(made.positions)
    )


def _cloud(moment: Moment, limit: int) -> EventCloud:
    events, window = moment.events, moment.window
    chosen = np.arange(len(events))
    if len(events) > limit:
        chosen = np.linspace(0, len(events) - 1, limit).round().astype(np.int64)
    positions = np.empty((len(chosen), 3), np.float32)
    positions[:, 0] = events.x[chosen] + 0.5
    positions[:, 1] = events.y[chosen] + 0.5
    positions[:, 2] = (window.t_stop - events.t[chosen]) / max(window.t_stop - window.t_start, 1)
    colours = polarity_colours(events, chosen)
    return EventCloud(positions, colours, len(events), (window.t_stop - window.t_start) / 1000)
