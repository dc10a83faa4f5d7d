"""The window's events as a cloud of points, thinned evenly to what a browser can draw."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from app.present.moment import ARRAYS, Moment
from etnet.render.events import polarity_colours


@dataclass(frozen=True, slots=True, eq=False)
class EventCloud:
    """`points`: pixel x, pixel y (their middles) and age in ms, counted back from the window's end (0 is newest)."""

    points: Float32[np.ndarray, "n 3"]
    colours: UInt8[np.ndarray, "n 3"]
    num_events: int
    duration_ms: float

    @property
    def is_thinned(self) -> bool:
        """Whether some events are left out."""
        return len(self.points) < self.num_events


def event_cloud(moment: Moment, limit: int) -> EventCloud:
    """At most `limit` points: every k-th event, so that density over time and place is kept."""
    return ARRAYS.get(("cloud", moment.key, limit), lambda: _cloud(moment, limit), lambda made: 15 * len(made.points))


def _cloud(moment: Moment, limit: int) -> EventCloud:
    events, window = moment.events, moment.window
    chosen = np.arange(len(events))
    if len(events) > limit:
        chosen = np.linspace(0, len(events) - 1, limit).round().astype(np.int64)
    points = np.empty((len(chosen), 3), np.float32)
    points[:, 0] = events.x[chosen] + 0.5
    points[:, 1] = events.y[chosen] + 0.5
    points[:, 2] = (window.t_stop - events.t[chosen]) / 1000
    colours = polarity_colours(events)[chosen]
    return EventCloud(points, colours, len(events), (window.t_stop - window.t_start) / 1000)
