"""The timeline's curves, as arrays: all run over window indices, as the slider does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from etnet.windows import Window

NUM_POINTS = 240
"""Windows looked at for the event-rate curve; enough for a strip of 1,000 pixels."""

MICROSECONDS = 1_000_000


@dataclass(frozen=True, slots=True)
class RateCurve:
    """Events per second and end stamps (µs) of some windows, in order."""

    indices: Int64[np.ndarray, " n"]
    rates: Float64[np.ndarray, " n"]
    stamps: Int64[np.ndarray, " n"]


def rate_curve(windows: Sequence[Window], num_points: int = NUM_POINTS) -> RateCurve:
    """The event rate at up to `num_points` windows, evenly over all; the others are never planned."""
    indices = np.unique(
        np.linspace(0, max(len(windows) - 1, 0), min(num_points, len(windows))).round().astype(np.int64)
    )
    chosen = [windows[int(i)] for i in indices]
    rates = np.array([w.num_events / max(w.t_stop - w.t_start, 1) * MICROSECONDS for w in chosen], np.float64)
    return RateCurve(indices, rates, np.array([w.t_stop for w in chosen], np.int64))


def area_path(curve: RateCurve, num_windows: int, width: float, height: float) -> str:
    """An SVG path that fills the curve from its foot; x is the window index, y the rate, 0 … the maximum."""
    if len(curve.indices) == 0:
        return ""
    top = max(float(curve.rates.max()), 1e-9)
    xs = curve.indices / max(num_windows - 1, 1) * width
    ys = height * (1 - curve.rates / top)
    line = " ".join(f"L{x:.1f} {y:.1f}" for x, y in zip(xs, ys, strict=True))
    return f"M{xs[0]:.1f} {height:g} {line} L{xs[-1]:.1f} {height:g} Z"


def nice_step(span: float, num_ticks: int) -> float:
    """A step of 1, 2 or 5 × 10ⁿ that puts at most `num_ticks` ticks on a span; `span` > 0."""
    rough = span / max(num_ticks, 1)
    decade = 10.0 ** np.floor(np.log10(rough))
    return float(next(decade * m for m in (1, 2, 5, 10) if decade * m >= rough * (1 - 1e-9)))


def second_ticks(curve: RateCurve, t_zero: int, num_ticks: int = 6) -> list[tuple[float, float]]:
    """(window index, seconds since `t_zero`) at round times. Indices may lie between windows."""
    if len(curve.stamps) < 2 or curve.stamps[-1] <= curve.stamps[0]:
        return []
    seconds = (curve.stamps - t_zero) / MICROSECONDS
    step = nice_step(float(seconds[-1] - seconds[0]), num_ticks)
    first = np.ceil(seconds[0] / step - 1e-9)
    times = np.arange(first, np.floor(seconds[-1] / step + 1e-9) + 1) * step
    return [(float(i), float(t)) for i, t in zip(np.interp(times, seconds, curve.indices), times, strict=True)]


def frame_ticks(stamps: Int64[np.ndarray, " n"], curve: RateCurve) -> Float64[np.ndarray, " n"]:
    """Window indices (fractions allowed) at which camera frames were taken; those outside the curve are left out."""
    if len(curve.stamps) == 0:
        return np.empty(0)
    inside = stamps[(stamps >= curve.stamps[0]) & (stamps <= curve.stamps[-1])]
    return np.interp(inside, curve.stamps, curve.indices)
