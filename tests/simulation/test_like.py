"""A twin is measured of a recording whose sensor is known, because we simulated it."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, Recording, recording_of_events
from etnet.simulation.like import Twin, beside, measure_twin
from etnet.simulation.settings import PixelSettings
from tests.simulation.known_motion import FRAME_US, KnownScene

SIZE = (96, 72)
REAL = PixelSettings(pos_thres=0.35, neg_thres=0.25, shot_noise_rate_hz=0.2, refractory_us=500.0)


def recorded(with_frames: bool, sensor: PixelSettings = REAL) -> Recording:
    """All moments of a scene seen by a sensor, with every 40th as a frame."""
    from etnet.simulation.footage import Frame
    from etnet.simulation.streaming import EventSimulator
    from etnet.simulation.walk import Stepping

    scene = KnownScene(3.0, True, SIZE, num_frames=11)
    lights = list(scene.moments())
    with EventSimulator(sensor.traits, Stepping("off"), 3, threads=1) as simulator:
        shown = (Frame(i * FRAME_US / 40, light) for i, light in enumerate(lights))
        events = Events.concatenate([found for _, found in simulator.run(shown)], Sensor(*SIZE))
    stamps = np.floor(np.arange(11) * FRAME_US).astype(np.int64)
    truth = GroundTruth(stamps, lambda i: lights[40 * i]) if with_frames else None
    return recording_of_events(events, "real", ground_truth=truth)


@lru_cache(maxsize=8)
def twin_of(sensor: PixelSettings = REAL) -> Twin:
    return measure_twin(recorded(True, sensor))


def test_a_twin_has_the_thresholds_rate_and_share_of_the_real_one():
    twin = twin_of()
    assert twin.pixels.pos_thres == pytest.approx(REAL.pos_thres, rel=0.2)
    assert twin.pixels.neg_thres == pytest.approx(REAL.neg_thres, rel=0.2)
    assert twin.simulated.rate == pytest.approx(twin.real.rate, rel=0.1)
    assert twin.simulated.on_share == pytest.approx(twin.real.on_share, abs=0.03)
    assert twin.correlation > 0.5
    assert len(list(beside(twin))) == 6


def test_what_was_assumed_and_how_each_bandwidth_fared_is_said():
    told = " ".join(twin_of().remarks)
    assert "assumed, not measured: sigma_thres 0.03, leak_rate_hz 0.1" in told
    assert "taken as linear" in told
    for tried in ("no limit", "160 Hz", "100 Hz", "40 Hz", "15 Hz"):
        assert f"{tried} 0." in told


def test_the_dead_time_is_measured_where_noise_does_not_hide_it():
    assert REAL.refractory_us <= twin_of().pixels.refractory_us < 1.5 * REAL.refractory_us


def test_the_shot_noise_is_found():
    noisy = replace(REAL, shot_noise_rate_hz=2.0)
    assert twin_of(noisy).pixels.shot_noise_rate_hz == pytest.approx(2.0, rel=0.3)
    assert twin_of().pixels.shot_noise_rate_hz < 0.5


def test_a_lag_is_found():
    assert twin_of().pixels.lag_us < 2_000
    assert twin_of(replace(REAL, lag_us=8_000)).pixels.lag_us == pytest.approx(8_000, abs=1_500)


def test_a_limited_bandwidth_is_found_to_a_step_and_none_where_there_is_none():
    found = twin_of(replace(REAL, cutoff_hz=40.0)).pixels
    assert 25 <= found.cutoff_hz <= 64
    assert found.pos_thres == pytest.approx(REAL.pos_thres, rel=0.2)
    assert found.neg_thres == pytest.approx(REAL.neg_thres, rel=0.2)
    assert twin_of().pixels.cutoff_hz == 0


def test_that_few_frames_tell_little_is_said(monkeypatch):
    assert not any("hardly known" in text for text in twin_of().remarks)
    monkeypatch.setattr("etnet.simulation.like.TRIAL_FRAMES", 4)
    assert any("only 4 frames: thresholds" in text for text in measure_twin(recorded(True)).remarks)


def test_without_frames_the_noise_is_measured_and_the_rest_is_said_to_be_assumed():
    twin = measure_twin(recorded(False))
    assert twin.correlation is None
    assert twin.pixels.shot_noise_rate_hz > 0
    told = " ".join(twin.remarks)
    assert "thresholds and bandwidth are assumed" in told
    assert "a quarter of what nothing supports is taken as shot noise" in told
    assert list(beside(twin)) == []
