"""Sensors for training are drawn around those that were measured."""

import numpy as np
import pytest

from etnet.simulation.measured import sensors_around
from etnet.simulation.sensor import draw_traits
from etnet.simulation.settings import CAMERAS, PixelSettings

MEASURED = [
    PixelSettings(pos_thres=0.86, neg_thres=0.6, sigma_thres=0.03, refractory_us=400, lag_us=3_000, cutoff_hz=100),
    PixelSettings(pos_thres=0.5, neg_thres=0.4, sigma_thres=0.03, shot_noise_rate_hz=0.1, lag_us=5_000),
]


def test_drawn_sensors_lie_around_the_measured_ones():
    config, rng = sensors_around(MEASURED, 1.2), np.random.default_rng(0)
    drawn = [draw_traits(config, rng) for _ in range(400)]
    thresholds = np.array([(one.threshold_on * one.threshold_off) ** 0.5 for one in drawn])
    low, high = 0.2**0.5 / 1.2, 0.516**0.5 * 1.2
    assert ((thresholds > low - 1e-6) & (thresholds < high + 1e-6)).mean() > 0.8
    ratios = np.array([one.threshold_on / one.threshold_off for one in drawn])
    assert np.exp(np.log(ratios).mean()) == pytest.approx((0.86 / 0.6 * 0.5 / 0.4) ** 0.5, rel=0.05)
    assert all(3_000 / 1.2 <= one.lag_us <= 5_000 * 1.2 for one in drawn)
    assert all(400 / 1.2 <= one.refractory_us <= 400 * 1.2 for one in drawn)
    assert all(1e6 / (2 * np.pi * 120) <= one.low_pass_us <= 1.2 * 1e6 / (2 * np.pi * 100) for one in drawn)


def test_what_was_measured_as_nothing_stays_off_and_every_camera_gives_a_valid_range():
    config = sensors_around([PixelSettings()])
    assert (config.leak_hz, config.shot_hz, config.low_pass_us, config.lag_us) == ((0.0, 0.0),) * 4
    assert all(sensors_around([camera.pixels]).threshold_core[0] > 0.01 for camera in CAMERAS.values())
    with pytest.raises(ValueError, match="wanted one or more"):
        sensors_around([])
