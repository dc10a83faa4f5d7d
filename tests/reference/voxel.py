"""Eq. 1 of the paper, event by event and bin by bin."""

import numpy as np

from etnet.events.events import Events


def voxel_by_equation(events: Events, bins: int) -> np.ndarray:
    """V(k) = Σ p · max(0, 1 − |k − (t − t₀)/(t_N − t₀) (B − 1)|); equal stamps to bin 0; under 3 events zeros."""
    grid = np.zeros((bins, events.sensor.height, events.sensor.width))
    if len(events) < 3:
        return grid
    first, last = int(events.t[0]), int(events.t[-1])
    for x, y, t, p in zip(events.x, events.y, events.t.tolist(), events.p.tolist(), strict=True):
        phase = 0.0 if first == last else (t - first) / (last - first) * (bins - 1)
        for k in range(bins):
            grid[k, y, x] += p * max(0.0, 1 - abs(k - phase))
    return grid
