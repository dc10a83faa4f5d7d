"""Events made up by hypothesis."""

import numpy as np
from hypothesis import strategies as st

from etnet.events.events import Events, Sensor

SMALL = Sensor(20, 12)


def make_events(num_events: int, sensor: Sensor = SMALL, seed: int = 0, duration: int = 50_000) -> Events:
    """Random events, uniform over the sensor and the time."""
    rng = np.random.default_rng(seed)
    return Events(
        rng.integers(0, sensor.width, num_events).astype(np.uint16),
        rng.integers(0, sensor.height, num_events).astype(np.uint16),
        np.sort(rng.integers(0, duration + 1, num_events)).astype(np.int64),
        rng.choice([-1, 1], num_events).astype(np.int8),
        sensor,
    )


@st.composite
def events(draw: st.DrawFn, max_events: int = 60) -> Events:
    """Few events on a small sensor, with equal stamps, bursts and far-away clocks among them."""
    sensor = Sensor(draw(st.integers(1, 9)), draw(st.integers(1, 7)))
    num_events = draw(st.integers(0, max_events))
    start = draw(st.sampled_from([0, 17, 1_600_000_000_000_000]))
    stamps = draw(
        st.lists(st.integers(0, draw(st.sampled_from([0, 1, 30, 10**6]))), min_size=num_events, max_size=num_events)
    )
    pick = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return Events(
        pick.integers(0, sensor.width, num_events).astype(np.uint16),
        pick.integers(0, sensor.height, num_events).astype(np.uint16),
        np.array(sorted(stamps), np.int64) + start,
        pick.choice([-1, 1], num_events).astype(np.int8),
        sensor,
    )
