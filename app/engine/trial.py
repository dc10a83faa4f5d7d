"""How long a step will take, told before the first one from a trial of a small one."""

from __future__ import annotations

from typing import Any

from etnet.errors import WindowError
from etnet.events.events import Sensor

_HEIGHT, _WIDTH = 96, 128
_GROWTH = 1.2
"""A step's time grows with this power of the pixels: 1.1 (half width) … 1.3 measured from 240×184 to 352×264."""


def trial_milliseconds(model: Any) -> float:
    """A step over an empty 128×96 window, after one that is not counted, ms."""
    import torch

    from etnet.nets.intervention import ORIGINAL
    from etnet.nets.precision import best_of
    from etnet.nets.runtime import device_of, wait_for

    device = device_of(model)
    voxel = torch.zeros(1, model.bins, _HEIGHT, _WIDTH, device=device)

    def step() -> None:
        pyramid, _ = model.encode(voxel, None, ORIGINAL)
        model.decode(pyramid, None, ORIGINAL)
        wait_for(device)

    with torch.inference_mode():
        return best_of(step, runs=1) * 1000


def expected_step(trial: float, sensor: Sensor) -> float:
    """A step at a sensor's size, ms, from the trial's."""
    return trial * (sensor.num_pixels / (_HEIGHT * _WIDTH)) ** _GROWTH


def check_step(expected: float, sensor: Sensor, longest: float | None) -> None:
    """A step expected to take longer than `longest` (ms; `None`: any) is a `WindowError`: nothing can stop it."""
    if longest is not None and expected > longest:
        raise WindowError(
            f"an image of {sensor} would take about {expected / 1000:.0f} s here,"
            f" at most {longest / 1000:.0f} s are given to one; start the viewer with --downsample 4 or --roi"
        )
