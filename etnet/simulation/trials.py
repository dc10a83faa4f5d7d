"""Settings found by trial: a recording's own frames are simulated until the events are like those that it has.

Thresholds follow the numbers of ON and OFF events, shot noise the events that nothing near supports, the lag and the
bandwidth the correlation of the voxels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Int64

from etnet.events.denoise import Support
from etnet.events.events import Events, Sensor
from etnet.events.fitness import SUPPORT_WITHIN
from etnet.simulation.beginning import Beginning
from etnet.simulation.footage import Frame
from etnet.simulation.settings import PixelSettings
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.walk import Stepping
from etnet.voxel import voxel_array

ROUNDS = 4
"""Simulations after which the thresholds have settled."""
CUTOFFS = (0.0, 100.0, 40.0, 15.0)
"""Bandwidths that are tried, Hz; 0 is no limit. Then those half a step from the best one."""
_HALF_STEP = 1.6
_NO_LIMIT = 160.0
"""What is tried half a step from no limit, Hz."""
_BETTER = 0.002
"""By so much more the voxels must correlate under another bandwidth."""
_LAG_STEP = 1_000.0
"""µs to which a lag is found."""
_ALONE = 0.5, 0.02, 1.25
"""Events that stand alone for each event of shot noise: the first guess, and the bounds."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """A part of a recording: its frames as light, the events among them, the frames' stamps (µs)."""

    frames: list[Frame]
    events: Events
    edges: Int64[np.ndarray, " n"]

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return (self.frames[-1].t - self.frames[0].t) / 1e6


@dataclass(frozen=True, eq=False)
class Trial:
    """Settings that have settled, what they make of the frames, and how far the voxels correlate."""

    pixels: PixelSettings
    events: Events
    correlation: float


def best_trial(
    pixels: PixelSettings, recorded: Recorded, told: Callable[[float], None]
) -> tuple[Trial, dict[float, float]]:
    """The trial whose voxels correlate best with the recorded ones, and the correlation of each bandwidth.

    `pixels` are what the search begins with; its lag is the longest one that is tried.
    """
    # What lies between two frames depends on no threshold, so it is found once.
    known = Beginning(np.inf)
    recorded = replace(recorded, frames=list(known.frames(recorded.frames)))
    best, tried, waiting = None, dict[float, float](), list(CUTOFFS)
    while waiting:
        cutoff = waiting.pop(0)
        begun = replace(best.pixels if best else pixels, cutoff_hz=cutoff)
        trial = _settled(begun, pixels.lag_us, recorded, known)
        tried[cutoff] = trial.correlation
        if best is None or trial.correlation > best.correlation + _BETTER:
            best = trial
        if len(tried) == len(CUTOFFS):
            at = best.pixels.cutoff_hz
            waiting = [_NO_LIMIT] if at == 0 else [round(at * _HALF_STEP), round(at / _HALF_STEP)]
        told(len(tried) / max(len(tried) + len(waiting), len(CUTOFFS) + 2))
    assert best is not None
    return best, tried


def simulated_from_frames(
    pixels: PixelSettings, frames: list[Frame], seed: int = 0, known: Beginning | None = None
) -> Events:
    """What a sensor with these settings sees of the frames. What `known` keeps of them is not computed once more."""
    height, width = frames[0].light.shape
    with EventSimulator(pixels.traits, Stepping(), seed, beginning=known) as simulator:
        parts = [events for _, events in simulator.run(frames)]
    return Events.concatenate(parts, Sensor(width, height))


def voxel_correlation(real: Events, simulated: Events, edges: Int64[np.ndarray, " n"]) -> float:
    """Mean correlation of the two's voxel grids, window by window."""
    found = []
    cuts = [np.searchsorted(events.t, edges).tolist() for events in (real, simulated)]
    for (a, b), (c, d) in zip(pairwise(cuts[0]), pairwise(cuts[1]), strict=True):
        one, other = voxel_array(real[a:b]).ravel(), voxel_array(simulated[c:d]).ravel()
        if one.any() and other.any():
            found.append(float(np.corrcoef(one, other)[0, 1]))
    return float(np.mean(found)) if found else 0.0


def _settled(pixels: PixelSettings, longest_lag: float, recorded: Recorded, known: Beginning) -> Trial:
    """Thresholds at which as many ON and OFF events come as in the recording, noise at which as many stand alone, and
    the lag that fits best."""
    real = recorded.events
    wanted, wanted_alone = [max(int((real.p == sign).sum()), 1) for sign in (1, -1)], _alone(recorded, real)
    events = simulated_from_frames(pixels, recorded.frames, known=known)
    noise, gain = list[tuple[float, float]](), _ALONE[0]
    for _ in range(ROUNDS):
        got = [max(int((events.p == sign).sum()), 1) for sign in (1, -1)]
        # The two drive each other (an ON event moves the level that the next OFF event starts from): go half the way.
        on, off = (
            float(np.clip(value * (have / want) ** 0.6, 0.02, 4.0))
            for value, have, want in zip((pixels.pos_thres, pixels.neg_thres), got, wanted, strict=True)
        )
        noise.append((pixels.shot_noise_rate_hz, _alone(recorded, events)))
        if len(noise) > 1 and abs(noise[-1][0] - noise[-2][0]) > 1e-4:
            slope = (noise[-1][1] - noise[-2][1]) / (noise[-1][0] - noise[-2][0])
            gain = float(np.clip(slope, *_ALONE[1:]))
        shot = max(0.0, noise[-1][0] + (wanted_alone - noise[-1][1]) / gain)
        pixels = replace(pixels, pos_thres=on, neg_thres=off, shot_noise_rate_hz=float(f"{min(shot, 1e4):.4g}"))
        events = simulated_from_frames(pixels, recorded.frames, known=known)
    return _on_time(Trial(pixels, events, 0.0), longest_lag, recorded)


def _alone(recorded: Recorded, events: Events) -> float:
    """Events of a pixel each second that nothing near supports."""
    places = events.y.astype(np.int64) * events.sensor.width + events.x
    supported = Support(events.sensor, SUPPORT_WITHIN).take(places, events.t)
    return int((~supported).sum()) / events.sensor.num_pixels / recorded.seconds


def _on_time(trial: Trial, longest: float, recorded: Recorded) -> Trial:
    """The trial with the lag under which its voxels correlate best: 0 … `longest`, found in steps that halve."""
    real, edges = recorded.events, recorded.edges
    made = _shifted(trial.events, -trial.pixels.lag_us)
    alike: dict[float, float] = {}

    def at(lag: float) -> float:
        if lag not in alike:
            alike[lag] = voxel_correlation(real, _shifted(made, lag), edges)
        return alike[lag]

    step, best = longest / 4, 0.0
    for lag in np.linspace(0, longest, 5).tolist() if longest >= _LAG_STEP else [0.0]:
        best = max(best, lag, key=at)
    while step > _LAG_STEP:
        step /= 2
        best = max((lag for lag in (best - step, best, best + step) if 0 <= lag <= longest), key=at)
    pixels = replace(trial.pixels, lag_us=round(best, 1))
    return Trial(pixels, _shifted(made, best), at(best))


def _shifted(events: Events, lag: float) -> Events:
    return replace(events, t=events.t + round(lag))
