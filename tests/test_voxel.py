"""Laws of the voxel grid (eq. 1)."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from etnet.events.events import Events, Sensor
from etnet.voxel import MIN_EVENTS, bin_votes, normalise_nonzero, voxel_array, voxel_grid
from tests.reference.voxel import voxel_by_equation
from tests.strategies import events, make_events


@given(events(), st.integers(1, 7))
def test_equals_the_equation(some: Events, bins: int):
    np.testing.assert_allclose(voxel_array(some, bins), voxel_by_equation(some, bins), atol=1e-5)


@given(events(), st.integers(1, 7))
def test_votes_conserve_polarity(some: Events, bins: int):
    expected = some.p.sum(dtype=int) if len(some) >= 3 else 0
    np.testing.assert_allclose(voxel_array(some, bins).sum(dtype=float), expected, atol=1e-4)


@given(events())
def test_is_finite_and_never_writes_to_its_argument(some: Events):
    before = [column.copy() for column in (some.x, some.y, some.t, some.p)]
    assert np.isfinite(voxel_array(some)).all()
    for column, copy in zip((some.x, some.y, some.t, some.p), before, strict=True):
        np.testing.assert_array_equal(column, copy)


@given(events(), st.integers(-(10**6), 10**12))
def test_does_not_depend_on_the_clock(some: Events, shift: int):
    moved = Events(some.x, some.y, some.t + shift, some.p, some.sensor)
    np.testing.assert_array_equal(voxel_array(some), voxel_array(moved))


def test_flipping_polarity_negates_the_grid():
    some = make_events(500)
    flipped = Events(some.x, some.y, some.t, -some.p, some.sensor)
    np.testing.assert_array_equal(voxel_array(some), -voxel_array(flipped))


def test_equal_stamps_go_to_bin_zero():
    sensor = Sensor(3, 2)
    some = Events(
        np.array([0, 1, 2], np.uint16), np.zeros(3, np.uint16), np.full(3, 7, np.int64), np.ones(3, np.int8), sensor
    )
    grid = voxel_grid(some, 5)
    assert grid[0, 0].tolist() == [1, 1, 1]
    assert not grid[1:].any()


def test_last_event_votes_wholly_for_the_last_bin():
    some = make_events(200, seed=3)
    last = voxel_array(some)[-1, some.y[-1], some.x[-1]]
    without = voxel_array(Events(some.x, some.y, some.t, np.append(some.p[:-1], np.int8(0)), some.sensor))
    assert last - without[-1, some.y[-1], some.x[-1]] == some.p[-1]


@given(st.integers(1, 1 << 40), st.integers(2, 9))
def test_an_event_on_the_border_of_a_bin_leaves_nothing_in_the_next(step: int, bins: int):
    """One event a pixel, each where a bin lies: the grid holds their polarities and nothing else, to the last bit."""
    place = np.arange(bins)
    some = Events(
        np.append(place, 0).astype(np.uint16),
        np.append(0 * place, 1).astype(np.uint16),
        np.append(place * step, (bins - 1) * step),
        np.ones(bins + 1, np.int8),
        Sensor(bins, 2),
    )
    expected = np.zeros((bins, 2, bins), np.float32)
    expected[place, 0, place] = 1
    expected[-1, 1, 0] = 1
    np.testing.assert_array_equal(voxel_array(some, bins), expected)
    np.testing.assert_array_equal(bin_votes(some, bins).share, np.zeros(bins + 1))


def test_normalised_nonzero_entries_have_mean_zero_and_deviation_one():
    grid = voxel_grid(make_events(300), 5)
    normalised = normalise_nonzero(grid)
    values = normalised[grid != 0]
    assert abs(float(values.mean())) < 1e-6
    assert abs(float(values.std(correction=0)) - 1) < 1e-5
    assert not normalised[grid == 0].any()


def test_normalising_grids_with_nothing_to_scale_returns_them():
    zeros = torch.zeros(5, 3, 4)
    assert torch.equal(normalise_nonzero(zeros), zeros)
    ones = torch.zeros(5, 3, 4)
    ones[0, 0, 0] = 1
    assert torch.equal(normalise_nonzero(ones), ones)


@given(events(), st.integers(1, 6))
def test_single_votes_add_up_to_the_grid(window: Events, bins: int):
    votes = bin_votes(window, bins)
    grid = np.zeros((bins, window.sensor.height, window.sensor.width))
    if len(window) >= MIN_EVENTS:
        np.add.at(grid, (votes.lower, window.y, window.x), window.p * (1 - votes.share))
        np.add.at(grid, (votes.upper, window.y, window.x), window.p * votes.share)
    np.testing.assert_allclose(grid, voxel_array(window, bins), atol=1e-5)
