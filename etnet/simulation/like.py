"""A twin of a camera: the settings of a simulated sensor, measured of a recording, and both beside each other.

What events alone tell (noise, dead time) is measured of them. What needs light (thresholds, bandwidth, lag) is found by
trial: the recording's own frames are simulated, and the settings follow until as many ON and OFF events come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Int64

from etnet.errors import RecordingError
from etnet.events.events import Events
from etnet.events.fitness import Fitness, measure_fitness
from etnet.events.recording import GroundTruth, Recording
from etnet.simulation.footage import Frame
from etnet.simulation.settings import PixelSettings
from etnet.simulation.tone import Tone
from etnet.simulation.trials import Recorded, best_trial

TRIAL_FRAMES = 25
"""Frames of the recording that the trials go over, from its middle."""
FEWEST_FRAMES = 8
"""Fewer tell little: of a street's four frames the thresholds came to 2.8 and .09 (`docs/simulation.md`)."""
_UNMEASURED = {"sigma_thres": 0.03, "leak_rate_hz": 0.1}
"""What no measurement tells: values of a DAVIS (Brandli et al. 2014, Nozaki and Delbruck 2017)."""
_NOISE_SHARE = 0.25
"""Of what nothing near supports, so much is called shot noise: an edge's first event has no support either."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """What events look like. Rates are a pixel's, each second; intervals are between two events of one pixel, µs."""

    rate: float
    on_share: float
    active_share: float
    """Pixels with an event, of all, between two frames."""
    interval_1: float
    """1 % of the intervals are shorter."""
    interval_50: float
    interval_99: float


@dataclass(frozen=True, slots=True)
class Twin:
    """Settings that make a simulated sensor like the recording's, and how like it they made it on the trial frames.

    `correlation` is that of the voxels of each window between two frames; None where the recording has no frames.
    """

    pixels: PixelSettings
    real: Statistics | None
    simulated: Statistics | None
    correlation: float | None
    remarks: tuple[str, ...]


def measure_twin(
    recording: Recording, tone: Tone | None = None, progress: Callable[[float], None] | None = None
) -> Twin:
    """The twin of the sensor that made `recording`; `tone` is that of its frames (linear by default, as a DAVIS's)."""
    told = progress or (lambda _: None)
    fitness = Fitness()
    for found, share in measure_fitness(recording):
        fitness = found
        told(0.3 * share)
    pixels, remarks = _of_events(fitness, recording)
    tone = tone or Tone("linear")
    frames = _trial_frames(recording, tone)
    if frames is None:
        remarks.append("it has no frames to try them on: thresholds and bandwidth are assumed")
        if fitness.activity is not None:
            remarks.append("a quarter of what nothing supports is taken as shot noise")
        return Twin(pixels, None, None, None, tuple(remarks))
    remarks.append(f"tried on {len(frames)} of its frames, which are taken as {tone}")
    if len(frames) < FEWEST_FRAMES:
        remarks.append(f"only {len(frames)} frames: thresholds, bandwidth and lag are hardly known from so few")
    recorded = _recorded(recording, frames)
    best, tried = best_trial(pixels, recorded, lambda share: told(0.3 + 0.7 * share))
    found = ", ".join(f"{_hertz(cutoff)} {alike:.3f}" for cutoff, alike in sorted(tried.items()))
    remarks.append(f"bandwidth: of those tried, the one whose voxels correlate best ({found})")
    remarks.append("shot noise: so much that as many events have none near them as in the recording")
    remarks.append(f"lag: {best.pixels.lag_us / 1000:.1f} ms, with which the voxels correlate best")
    real, made = (statistics(events, recorded.edges, recorded.seconds) for events in (recorded.events, best.events))
    return Twin(best.pixels, real, made, best.correlation, tuple(remarks))


def _hertz(cutoff: float) -> str:
    return f"{cutoff:g} Hz" if cutoff else "no limit"


def statistics(events: Events, edges: Int64[np.ndarray, " n"], seconds: float) -> Statistics:
    """Of events over windows that `edges` (µs) divide."""
    pixel = events.y.astype(np.int64) * events.sensor.width + events.x
    index = np.searchsorted(events.t, edges)
    active = [len(np.unique(pixel[a:b])) / events.sensor.num_pixels for a, b in pairwise(index.tolist())]
    order = np.lexsort((events.t, pixel))
    waits = np.diff(events.t[order])[np.diff(pixel[order]) == 0]
    low, middle, high = np.percentile(waits, [1, 50, 99]).tolist() if len(waits) else (np.nan,) * 3
    share = float((events.p > 0).mean()) if len(events) else float("nan")
    rate = len(events) / events.sensor.num_pixels / seconds
    return Statistics(rate, share, float(np.mean(active)), low, middle, high)


def _of_events(fitness: Fitness, recording: Recording) -> tuple[PixelSettings, list[str]]:
    """Settings that the events alone tell, and what frames tell without a trial."""
    pixels = PixelSettings(**_UNMEASURED)
    remarks = ["assumed, not measured: " + ", ".join(f"{name} {value:g}" for name, value in _UNMEASURED.items())]
    activity, lag, thresholds = fitness.activity, fitness.lag, fitness.thresholds
    if activity is not None:
        num_hot, share = len(fitness.hot), len(fitness.hot) / recording.sensor.num_pixels
        seconds = max(recording.span.duration, 1) / 1e6
        each = sum(pixel.num_events for pixel in fitness.hot) / max(num_hot, 1) / seconds
        pixels = replace(
            pixels,
            shot_noise_rate_hz=round(activity.noise_rate * _NOISE_SHARE, 4),
            refractory_us=round(activity.refractory or 0.0, 1),
            hot_share=round(share, 6),
            # A simulated hot pixel has 0.2 … 1 of it.
            hot_hz=round(each / 0.6, 2) if num_hot else pixels.hot_hz,
        )
        if num_hot:
            remarks.append(f"{num_hot} hot pixels, {each:.3g} Hz each on average")
        remarks.append(f"noise that nothing supports: {activity.noise_rate:.3f} Hz a pixel")
        remarks.append(
            "dead time: too few events to measure it; taken as 0"
            if activity.refractory is None
            else f"dead time: 1 in 1,000 waits of a pixel is shorter than {activity.refractory:g} µs"
        )
    if lag is not None:
        pixels = replace(pixels, lag_us=float(max(lag.shift, 0)))
        used = "" if lag.shift >= 0 else ", which is taken as 0: no sensor is ahead of the light"
        remarks.append(f"events follow the frames by {lag.shift / 1000:.0f} ms{used}")
    if thresholds is not None and min(thresholds.on, thresholds.off) > 0.01:
        on, off = (float(np.clip(value, 0.02, 4.0)) for value in (thresholds.on, thresholds.off))
        pixels = replace(pixels, pos_thres=on, neg_thres=off)
    return pixels, remarks


def _trial_frames(recording: Recording, tone: Tone) -> list[Frame] | None:
    truth = recording.ground_truth
    inside = [] if truth is None else _inside(recording, truth)
    if truth is None or len(inside) < 3:
        return None
    if truth.read_frame(0).shape != (recording.sensor.height, recording.sensor.width):
        return None
    begin = max(0, (len(inside) - TRIAL_FRAMES) // 2)
    chosen = inside[begin : begin + TRIAL_FRAMES]
    return [Frame(float(truth.stamps[i]), tone.light(truth.read_frame(i)).astype(np.float32)) for i in chosen]


def _inside(recording: Recording, truth: GroundTruth) -> list[int]:
    is_inside = (truth.stamps >= recording.span.start) & (truth.stamps <= recording.span.stop)
    return np.flatnonzero(is_inside & (np.diff(truth.stamps, prepend=truth.stamps[0] - 1) > 0)).tolist()


def _recorded(recording: Recording, frames: list[Frame]) -> Recorded:
    edges = np.array([int(frame.t) for frame in frames], np.int64)
    events = recording.read(recording.index_at(int(edges[0])), recording.index_at(int(edges[-1])))
    if len(events) == 0:
        raise RecordingError(f"{recording.name}: no events lie between its frames; a twin cannot be measured of it")
    return Recorded(frames, events, edges)


def beside(twin: Twin) -> Iterator[tuple[str, str, str]]:
    """Rows of a table: what, the recording's, the simulated sensor's."""
    if twin.real is None or twin.simulated is None:
        return
    rows = (
        ("events of a pixel each second", "rate", "{:.2f}"),
        ("share of ON events", "on_share", "{:.1%}"),
        ("pixels with an event between two frames", "active_share", "{:.1%}"),
        ("interval, 1st percentile (ms)", "interval_1", "{:.2f}"),
        ("interval, median (ms)", "interval_50", "{:.1f}"),
        ("interval, 99th percentile (ms)", "interval_99", "{:.0f}"),
    )
    for what, name, form in rows:
        scale = 1e-3 if name.startswith("interval") else 1.0
        yield what, form.format(getattr(twin.real, name) * scale), form.format(getattr(twin.simulated, name) * scale)
