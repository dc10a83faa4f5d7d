"""Keeping up: how long a step takes on this machine, and the windows and the binning that fit it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import torch

from etnet.events.events import Sensor
from etnet.nets.base import Reconstructor
from etnet.nets.runtime import device_of
from etnet.windows import ByDensity, ByDuration, Policy

DENSITY = 0.35
"""Events per pixel and window that networks are trained with."""
DENSEST = 1.0
"""Events per pixel and window up to which they do well."""
SPARE = 1.25
"""Windows last so much longer than a step, so that a busy moment is made up for."""
LONGEST = 0.125
"""Seconds of the longest window that is chosen for a slow step. A slower one is met by merging what waits, which also
ends with the busy moment in which a step was measured."""
_STEPS = 3


@dataclass(frozen=True, slots=True)
class Pace:
    """The windows that fit, and why."""

    policy: Policy
    step_seconds: float
    said: str


def measured_step(model: Reconstructor, sensor: Sensor, clock: Callable[[], float] = time.perf_counter) -> float:
    """Seconds of one step at this size: the fastest of a few, after one that warms up."""
    rng = torch.Generator().manual_seed(0)
    voxel = torch.randn(1, model.bins, sensor.height, sensor.width, generator=rng).to(device_of(model))
    state, seconds = None, []
    with torch.inference_mode():
        for _ in range(_STEPS + 1):
            began = clock()
            step = model(voxel, state)
            step.frame[..., 0, 0].cpu()  # waits for a GPU
            state = step.state
            seconds.append(clock() - began)
    return min(seconds[1:])


def fitting_policy(step_seconds: float, events_per_second: float, sensor: Sensor) -> Pace:
    """Windows by density as networks are trained, denser where events come too fast for that, by duration beyond it."""
    fits = min(SPARE * step_seconds, LONGEST)
    density = events_per_second * fits / sensor.num_pixels
    said = f"a step takes {1000 * step_seconds:.0f} ms at {sensor}"
    merged = "; they are merged while a step is slower" if SPARE * step_seconds > LONGEST else ""
    rate = f"{events_per_second / 1e6:.2f} Mev/s"
    if density <= DENSITY:
        return Pace(ByDensity(DENSITY), step_seconds, f"{said}: windows of {DENSITY} events per pixel{merged}")
    if density <= DENSEST:
        rounded = round(density + 0.005, 2)
        words = f"{said}, {rate}: windows of {rounded:g} events per pixel{merged}"
        return Pace(ByDensity(rounded), step_seconds, words)
    milliseconds = max(5, -(-round(1000 * fits) // 5) * 5)
    said = f"{said}, {rate}: windows of {milliseconds} ms{merged}"
    return Pace(ByDuration(1000 * milliseconds), step_seconds, said)
