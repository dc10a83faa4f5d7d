"""One million events into five bins, one core: ours beside numpy's `add.at` in float64 and torch's `index_put_`."""

from functools import partial

import numpy as np
import torch
from measure import best_of_each, report

from etnet.events.events import Events, Sensor
from etnet.voxel import voxel_array

BINS, NUM_EVENTS, SENSOR = 5, 1_000_000, Sensor(346, 260)


def _events() -> Events:
    rng = np.random.default_rng(0)
    return Events(
        rng.integers(0, SENSOR.width, NUM_EVENTS).astype(np.uint16),
        rng.integers(0, SENSOR.height, NUM_EVENTS).astype(np.uint16),
        np.sort(rng.integers(0, 50_000, NUM_EVENTS)),
        rng.choice([-1, 1], NUM_EVENTS).astype(np.int8),
        SENSOR,
    )


def _votes(events: Events) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    phase = (events.t - events.t[0]) / (events.t[-1] - events.t[0]) * (BINS - 1)
    lower = np.floor(phase).astype(np.int64)
    return lower, np.minimum(lower + 1, BINS - 1), phase - lower


def with_add_at(events: Events) -> np.ndarray:
    """The plain way."""
    grid = np.zeros((BINS, SENSOR.height, SENSOR.width))
    lower, upper, share = _votes(events)
    np.add.at(grid, (lower, events.y, events.x), events.p * (1 - share))
    np.add.at(grid, (upper, events.y, events.x), events.p * share)
    return grid


def with_index_put(events: Events) -> torch.Tensor:
    """The way most training code does it."""
    grid = torch.zeros(BINS, SENSOR.height, SENSOR.width)
    lower, upper, share = _votes(events)
    x, y = torch.from_numpy(events.x.astype(np.int64)), torch.from_numpy(events.y.astype(np.int64))
    for bin_index, vote in ((lower, events.p * (1 - share)), (upper, events.p * share)):
        grid.index_put_((torch.from_numpy(bin_index), y, x), torch.from_numpy(vote).float(), accumulate=True)
    return grid


def main() -> None:
    """Time the three on one core."""
    torch.set_num_threads(1)
    events = _events()
    assert np.abs(voxel_array(events) - with_add_at(events)).max() < 1e-4
    ways = {"voxel_array": voxel_array, "np.add.at float64": with_add_at, "torch.index_put_": with_index_put}
    seconds = best_of_each({name: partial(way, events) for name, way in ways.items()})
    floor = seconds["np.add.at float64"]
    rows = [
        {"way": name, "milliseconds": took * 1e3, "million_events_per_s": 1 / took, "times_add_at": floor / took}
        for name, took in seconds.items()
    ]
    report("voxel", rows)


if __name__ == "__main__":
    main()
