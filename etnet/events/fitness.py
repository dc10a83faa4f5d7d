"""What kind of sensor made a recording, and under what settings: what a network's training has to cover.

All are estimates from the events themselves, and from the camera's frames where there are any.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from etnet.events.denoise import Support
from etnet.events.examine import hot_pixels
from etnet.events.pixel_counts import HotPixel, check_countable
from etnet.events.recording import GroundTruth, Recording

SUPPORT_WITHIN = 20_000
"""µs within which a neighbour's event makes one believable; the rest is counted as noise."""
SHORTEST_SHARE = 0.1
"""Percent of all waits of a pixel that are shorter than what is called its refractory time."""
FARTHEST_LAG = 40_000
"""µs to either side that are searched for the lag between frames and events."""
_COARSE, _FINE = 5_000, 1_000
"""Steps of that search, µs: first over all of it, then around the best."""
_LAG_PAIRS = 6
_SIDE = 4
"""Pixels of a block's side, over which counts and changes are summed."""
_BLOCKS, _BLOCK = 8, 1 << 17
_PAIRS = 12
_DARKEST, _BRIGHTEST = 0.05, 0.95
"""Grey levels whose logarithm is trusted: darker ones are noise, brighter ones may be cut off."""
_FEWEST_PIXELS = 200


@dataclass(frozen=True, slots=True)
class Activity:
    """`noise_rate`: events per pixel and second that nothing near supports; an upper bound, as the first event of an
    edge has no support either. `refractory`: µs; 1 in 1,000 waits of one pixel is shorter. `None`: too few events.
    """

    num_looked_at: int
    on_share: float
    noise_rate: float
    refractory: float | None


@dataclass(frozen=True, slots=True)
class Lag:
    """`shift`: µs to add to the frames' stamps so that they fit the events best; `correlation` there and at 0."""

    shift: int
    correlation: float
    correlation_unshifted: float


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Change of log brightness that one event stands for, by least squares. `explained`: share of the change (R²).

    It is the effective threshold: events that a sensor's dead time and slow pixels swallow make it larger than the
    bias that was set (by 14–27 % in the bundled recordings, whose simulated sensors have both).
    """

    on: float
    off: float
    explained: float


@dataclass(frozen=True, slots=True)
class Fitness:
    """What is known so far; `None` where it was not measured, or cannot be (without frames)."""

    activity: Activity | None = None
    hot: tuple[HotPixel, ...] = ()
    lag: Lag | None = None
    thresholds: Thresholds | None = None


def measure_fitness(recording: Recording) -> Iterator[tuple[Fitness, float]]:
    """The findings so far and the share done, after each short stretch of work."""
    check_countable(recording)
    activity = None
    for activity, share in _activities(recording):
        yield Fitness(activity), 0.7 * share
    hot = hot_pixels(recording)
    yield Fitness(activity, hot), 0.8
    truth = recording.ground_truth
    if truth is None or not _pairs(recording, truth):
        yield Fitness(activity, hot), 1.0
        return
    lag = measure_lag(recording)
    yield Fitness(activity, hot, lag), 0.9
    yield Fitness(activity, hot, lag, measure_thresholds(recording, 0 if lag is None else lag.shift)), 1.0


def _activities(recording: Recording) -> Iterator[tuple[Activity | None, float]]:
    """Polarity, noise and refractory time, from blocks spread evenly over the recording."""
    num_blocks = max(1, min(_BLOCKS, -(-recording.num_events // _BLOCK)))
    starts = np.linspace(0, max(recording.num_events - _BLOCK, 0), num_blocks).astype(np.int64).tolist()
    looked = on = unsupported = duration = 0
    waits: list[Int64[np.ndarray, " n"]] = []
    if recording.num_events == 0:
        yield None, 1.0
    for done, start in enumerate(starts if recording.num_events else [], start=1):
        events = recording.read(start, min(start + _BLOCK, recording.num_events))
        places = events.y.astype(np.int64) * events.sensor.width + events.x
        supported = Support(recording.sensor, SUPPORT_WITHIN).take(places, events.t)
        # Before the first SUPPORT_WITHIN of a block is over, what supports an event may lie outside the block.
        is_settled = events.t > events.t[0] + SUPPORT_WITHIN
        unsupported += int((~supported & is_settled).sum())
        duration += max(int(events.t[-1] - events.t[0]) - SUPPORT_WITHIN, 0)
        looked += len(events)
        on += int((events.p > 0).sum())
        waits.append(_waits(places, events.t))
        every = np.concatenate(waits)
        refractory = float(np.percentile(every, SHORTEST_SHARE)) if len(every) >= _FEWEST_PIXELS else None
        rate = unsupported * 1e6 / (max(duration, 1) * recording.sensor.num_pixels)
        yield Activity(looked, on / looked, rate, refractory), done / len(starts)


def _waits(places: Int64[np.ndarray, " n"], t: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " m"]:
    """Microseconds between two events of one pixel."""
    order = np.argsort(places, kind="stable")
    same = np.diff(places[order]) == 0
    return np.diff(t[order])[same]


def measure_lag(recording: Recording) -> Lag | None:
    """Which shift of the frames' clock makes events and change of brightness correlate best.

    `None` without frames, or where nothing moves. The camera's exposure and read-out are part of it, and so is the
    wait of every event until a whole threshold is crossed: 3 … 5 ms in the bundled recordings, whose clocks agree.
    """
    truth = recording.ground_truth
    if truth is None:
        return None
    changes: list[tuple[int, Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]] = []
    for pair in _pairs(recording, truth, _LAG_PAIRS):
        change, is_sound = _log_change(truth, pair)
        changes.append((pair, change - np.median(change[is_sound]) if is_sound.any() else change, is_sound))
    coarse = range(-FARTHEST_LAG, FARTHEST_LAG + 1, _COARSE)
    found = {shift: _correlation(recording, truth, changes, shift) for shift in coarse}
    found = {shift: value for shift, value in found.items() if np.isfinite(value)}
    if 0 not in found:
        return None
    about = max(found, key=lambda shift: found[shift])
    for shift in range(max(about - _COARSE, -FARTHEST_LAG), min(about + _COARSE, FARTHEST_LAG) + 1, _FINE):
        found[shift] = _correlation(recording, truth, changes, shift)
    best = max(found, key=lambda shift: (np.nan_to_num(found[shift], nan=-1.0), -abs(shift)))
    return Lag(best, found[best], found[0])


def measure_thresholds(recording: Recording, shift: int = 0) -> Thresholds | None:
    """Least squares of the change of log brightness between two frames on the counts of ON and OFF events.

    Both are summed over blocks of pixels: an event stands for a whole threshold that was crossed, so that a single
    pixel's count is off by up to one, which would pull the estimate down; in sums these errors cancel. `shift` (µs)
    is added to the frames' stamps. `None` where too few pixels changed. Frames that are not in linear
    light (gamma, auto gain) scale the result.
    """
    truth = recording.ground_truth
    if truth is None:
        return None
    rows, targets = [], []
    for pair in _pairs(recording, truth):
        change, is_sound = _log_change(truth, pair)
        on, off, change = (_blocks(column, recording) for column in (*_counts(recording, truth, pair, shift), change))
        chosen = (_blocks(~is_sound, recording) == 0) & (on + off > 0)
        rows.append(np.stack([on[chosen], -off[chosen]], 1))
        targets.append(change[chosen])
    system, target = np.concatenate(rows), np.concatenate(targets)
    if len(target) < _FEWEST_PIXELS or not (system != 0).any(0).all():
        return None
    found, *_ = np.linalg.lstsq(system, target, rcond=None)
    explained = 1 - ((target - system @ found) ** 2).sum() / max((target**2).sum(), 1e-12)
    return Thresholds(float(found[0]), float(found[1]), float(explained))


def _pairs(recording: Recording, truth: GroundTruth, most: int = _PAIRS) -> list[int]:
    """First frames of up to `most` pairs whose events lie inside the recording, evenly spread."""
    inside = (truth.stamps[:-1] - FARTHEST_LAG >= recording.span.start) & (
        truth.stamps[1:] + FARTHEST_LAG <= recording.span.stop
    )
    found = np.flatnonzero(inside)
    if len(found) == 0 or truth.read_frame(0).shape != (recording.sensor.height, recording.sensor.width):
        return []
    return found[np.unique(np.linspace(0, len(found) - 1, min(most, len(found))).astype(int))].tolist()


def _log_change(truth: GroundTruth, pair: int) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Change of log brightness from frame `pair` to the next, and which pixels can be trusted."""
    before, after = (truth.read_frame(i).astype(np.float64).ravel() for i in (pair, pair + 1))
    is_sound = (np.minimum(before, after) > _DARKEST) & (np.maximum(before, after) < _BRIGHTEST)
    return np.log(np.maximum(after, 1e-3)) - np.log(np.maximum(before, 1e-3)), is_sound


def _counts(
    recording: Recording, truth: GroundTruth, pair: int, shift: int
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """ON and OFF events by pixel between two frames."""
    start, stop = (recording.index_at(int(truth.stamps[i]) + shift) for i in (pair, pair + 1))
    events = recording.read(start, stop)
    places = events.y.astype(np.int64) * recording.sensor.width + events.x
    size = recording.sensor.num_pixels
    on, off = (np.bincount(places[sign], minlength=size).astype(np.float64) for sign in (events.p > 0, events.p < 0))
    return on, off


def _blocks(column: np.ndarray, recording: Recording) -> Float64[np.ndarray, " m"]:
    """Sums over blocks of `_SIDE`² pixels; what does not fill one at the right and lower edge is left out."""
    rows, columns = recording.sensor.height // _SIDE, recording.sensor.width // _SIDE
    image = column.reshape(recording.sensor.height, recording.sensor.width)[: rows * _SIDE, : columns * _SIDE]
    return image.reshape(rows, _SIDE, columns, _SIDE).sum((1, 3), dtype=np.float64).ravel()


def _correlation(
    recording: Recording,
    truth: GroundTruth,
    changes: list[tuple[int, Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]],
    shift: int,
) -> float:
    parts = []
    for pair, change, is_sound in changes:
        on, off = _counts(recording, truth, pair, shift)
        parts.append(np.stack([(on - off)[is_sound], change[is_sound]]))
    signed, change = np.concatenate(parts, axis=1)
    if len(signed) < _FEWEST_PIXELS or signed.std() == 0 or change.std() == 0:
        return float("nan")
    return float(np.corrcoef(signed, change)[0, 1])
