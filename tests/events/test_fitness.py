"""What is said of a recording's sensor is what was put into it, and nothing is said that cannot be known."""

from functools import cache

import numpy as np
import pytest

from etnet.bundled import samples
from etnet.events.events import Events, Sensor
from etnet.events.fitness import measure_fitness, measure_lag, measure_thresholds
from etnet.events.open import open_recording
from etnet.events.recording import GroundTruth, recording_of_events
from tests.real_data import real_file

SENSOR = Sensor(48, 40)
FRAME_GAP = 20_000
NUM_FRAMES = 16


def log_brightness(t):
    """A pattern that moves right by 120 pixels a second, at time t (µs)."""
    rows, columns = np.mgrid[: SENSOR.height, : SENSOR.width]
    return -1.2 + 0.8 * np.sin((columns - 120e-6 * t) / 2) * np.cos(rows / 9)


@cache
def ideal(on=0.2, off=0.15, frames_late=0):
    """An ideal sensor before it, and a camera whose clock is `frames_late` µs behind."""
    memory = log_brightness(0)
    columns = [[], [], [], []]
    for t in range(500, NUM_FRAMES * FRAME_GAP + 60_000, 500):
        now = log_brightness(t)
        for sign, step in ((1, on), (-1, off)):
            crossed = np.maximum(np.floor(sign * (now - memory) / step), 0).astype(int)
            y, x = np.nonzero(crossed)
            for column, part in zip(columns, (x, y, np.full(len(x), t), np.full(len(x), sign)), strict=True):
                column.append(np.repeat(part, crossed[y, x]))
            memory = memory + sign * crossed * step
    x, y, t, p = (np.concatenate(column) for column in columns)
    events = Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), p.astype(np.int8), SENSOR)
    stamps = 50_000 + FRAME_GAP * np.arange(NUM_FRAMES - 4, dtype=np.int64)
    truth = GroundTruth(stamps - frames_late, lambda i: np.exp(log_brightness(int(stamps[i]))).astype(np.float32))
    return recording_of_events(events, ground_truth=truth)


def test_the_thresholds_of_an_ideal_sensor_are_found():
    found = measure_thresholds(ideal())
    assert found.on == pytest.approx(0.2, rel=0.08)
    assert found.off == pytest.approx(0.15, rel=0.08)
    assert found.explained > 0.9


@pytest.mark.parametrize("late", [7_000, -9_000])
def test_a_clock_that_is_behind_is_found_to_the_millisecond(late):
    # Events themselves wait for a whole threshold: that wait is in both.
    in_step, found = measure_lag(ideal()), measure_lag(ideal(frames_late=late))
    assert found.shift - in_step.shift == pytest.approx(late, abs=1_000)
    assert found.correlation >= found.correlation_unshifted


def test_without_frames_nothing_is_said_of_thresholds_and_lag():
    events = ideal().read(0, 5000)
    *_, (found, share) = measure_fitness(recording_of_events(events))
    assert share == 1.0
    assert found.lag is None
    assert found.thresholds is None
    assert found.activity.num_looked_at == 5000
    assert found.activity.on_share == pytest.approx((events.p > 0).mean())


def recorded(x, y, t):
    order = np.argsort(t, kind="stable")
    columns = (x[order].astype(np.uint16), y[order].astype(np.uint16), t[order].astype(np.int64))
    return recording_of_events(Events(*columns, np.ones(len(t), np.int8), SENSOR))


def test_noise_is_counted_and_a_hot_pixel_named():
    rng = np.random.default_rng(1)
    rate, seconds = 0.5, 4.0
    num = int(SENSOR.num_pixels * rate * seconds)
    t, x, y = (rng.integers(0, top, num) for top in (int(seconds * 1e6), SENSOR.width, SENSOR.height))
    burst = np.arange(0, int(seconds * 1e6), 3000)
    hot = np.full(len(burst), 7)
    recording = recorded(np.concatenate([x, hot]), np.concatenate([y, hot]), np.concatenate([t, burst]))
    *_, (found, _) = measure_fitness(recording)
    # Of random events, some find a neighbour within 20 ms by chance: e^(−8 · 0.5 · 0.02) = 92 % do not.
    alone = np.exp(-8 * rate * 0.02)
    assert found.activity.noise_rate == pytest.approx(alone * (rate + 333 / SENSOR.num_pixels), rel=0.1)
    assert [(pixel.x, pixel.y) for pixel in found.hot] == [(7, 7)]


def test_a_dead_time_is_found():
    rng = np.random.default_rng(2)
    t = np.cumsum(2_000 + rng.exponential(20_000, (100, 200)), axis=1).ravel()
    place = np.repeat(rng.permutation(SENSOR.num_pixels)[:100], 200)
    *_, (found, _) = measure_fitness(recorded(place % SENSOR.width, place // SENSOR.width, t))
    assert found.activity.refractory == pytest.approx(2_000, rel=0.05)


def test_a_sensor_that_loses_events_seems_to_have_larger_thresholds_than_it_was_given():
    with open_recording(samples()[0]) as recording:
        found = measure_thresholds(recording)
    assert 0.48 < found.on < 0.48 * 1.3
    assert 0.41 < found.off < 0.41 * 1.3


@pytest.mark.real
def test_the_exposure_of_a_real_camera_shows_as_a_lag():
    with open_recording(real_file("aedat4/davis346_newtons_cradle_0.5s.aedat4")) as recording:
        found = measure_lag(recording)
    assert found.correlation > found.correlation_unshifted + 0.2
    assert 5_000 < found.shift < 25_000
