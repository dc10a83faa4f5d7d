import numpy as np
import pytest

from etnet.simulation import camera
from etnet.simulation.config import SceneConfig


@pytest.mark.parametrize("seed", range(5))
def test_a_map_and_its_inverse_cancel(seed):
    path = camera.draw_background(np.random.default_rng(seed), (60, 80), is_static=False)
    maps = path.matrices(np.linspace(0, 50, 7), (90, 100))
    unit = camera.compose(maps, camera.invert(maps))
    assert np.allclose(unit, [[1, 0, 0], [0, 1, 0]], atol=1e-9)


def test_a_straight_background_only_shifts_a_pixel_a_unit_and_half_of_them_along_the_rows():
    s, along_rows = np.arange(5, dtype=np.float64), 0
    for seed in range(200):
        path = camera.draw_background(np.random.default_rng(seed), (60, 80), is_static=False, is_straight=True)
        maps = path.matrices(s, (60, 80))
        assert np.array_equal(maps[1:, :, :2], maps[:-1, :, :2])
        step = np.diff(maps[:, :, 2], axis=0)
        assert np.allclose(np.hypot(step[:, 0], step[:, 1]), 1)
        along_rows += bool(np.all(step[:, 1] == 0))
    assert 70 < along_rows < 130


def test_a_resting_background_has_one_map():
    path = camera.draw_background(np.random.default_rng(0), (60, 80), is_static=True)
    assert np.ptp(path.matrices(np.linspace(0, 99, 9), (90, 100)), axis=0).max() == 0


@pytest.mark.parametrize("seed", range(20))
def test_a_paused_window_stops_the_clock_and_the_first_one_never_pauses(seed):
    edges = np.cumsum(np.concatenate([[0.0], np.full(30, 10_000.0)]))
    config = SceneConfig(pause_start=0.3)
    clock, is_paused = camera.draw_clock(np.random.default_rng(seed), edges, 5_000.0, config, 0.7)
    travelled = np.diff(clock.at(edges))
    assert (travelled[is_paused] == 0).all()
    assert (travelled[~is_paused] > 0).all()
    assert not is_paused[0]
    assert clock.at(edges[:1] - 5_000) < clock.at(edges[:1])


def test_the_clock_runs_at_one_a_mean_window():
    edges = np.cumsum(np.concatenate([[0.0], np.full(30, 10_000.0)]))
    clock, _ = camera.draw_clock(np.random.default_rng(1), edges, 0.0, SceneConfig(pause_start=0.0), 0.0)
    assert clock.at(edges[-1:]) - clock.at(edges[:1]) == pytest.approx(30)
    assert clock.at_speed(3).at(edges[-1:]) == pytest.approx(3 * clock.at(edges[-1:]))


def test_a_rider_shares_its_carriers_shift_times_the_parallax():
    still = np.zeros((4, 1))
    carrier = camera.Trajectory(np.zeros(4), np.array([1.0, 2.0, 0.5, 0.0]), still, still, still)
    rider = camera.Trajectory(np.full(4, 5.0), np.zeros(4), still, still, still, carrier=carrier, parallax=1.5)
    assert np.allclose(rider.poses(np.array([0.0, 2.0])), [[5, 5, 5, 5], [8, 11, 5, 5]])


def test_steps_count_only_what_is_in_view():
    still = np.zeros((4, 1))
    ground = camera.Trajectory(np.zeros(4), np.zeros(4), still, still, still)
    away = camera.Trajectory(np.array([500.0, 500, 0, 0]), np.array([9.0, 0, 0, 0]), still, still, still)
    near = camera.Trajectory(np.array([30.0, 30, 0, 0]), np.array([0.0, 3, 0, 0]), still, still, still)
    s = np.arange(3.0)
    maps = [path.matrices(s, (10, 10)) for path in (ground, away, near)]
    assert np.allclose(camera.largest_steps(maps[:2], [(10, 10)] * 2, (60, 80)), 0)
    assert np.allclose(camera.largest_steps(maps, [(10, 10)] * 3, (60, 80)), 3)
