"""Intervals hold the mean, cover about as often as they say, and know the two ways of averaging."""

import math
import tracemalloc

import numpy as np
import pytest

from etnet.evaluation.bootstrap import RESAMPLES, average, block_bootstrap


def correlated(rng: np.random.Generator, length: int, memory: float) -> np.ndarray:
    values = np.empty(length)
    values[0] = rng.normal() / np.sqrt(1 - memory**2)
    for i in range(1, length):
        values[i] = memory * values[i - 1] + rng.normal()
    return values


def test_the_two_averages_differ_when_the_lengths_do() -> None:
    sequences = [np.array([1.0, 1.0, 1.0, np.nan]), np.array([5.0])]
    assert average(sequences, "sequences") == 3
    assert average(sequences, "frames") == 2
    assert np.isnan(average([np.array([np.nan])], "frames"))


def test_equal_frames_leave_no_doubt() -> None:
    assert block_bootstrap([np.full(20, 0.25)], np.random.default_rng(0)) == (0.25, 0.25, 0.25)


def test_the_same_seed_gives_the_same_interval() -> None:
    values = [correlated(np.random.default_rng(1), 50, 0.5)]
    first, second = (block_bootstrap(values, np.random.default_rng(7)) for _ in range(2))
    assert first == second
    assert first.low < first.mean < first.high


def test_blocks_see_the_likeness_of_neighbours_that_single_frames_hide() -> None:
    values = [correlated(np.random.default_rng(2), 400, 0.9)]
    blocks = block_bootstrap(values, np.random.default_rng(0), block=40)
    single = block_bootstrap(values, np.random.default_rng(0), block=1)
    assert blocks.high - blocks.low > 2 * (single.high - single.low)


def test_it_covers_the_true_mean_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(60):
        interval = block_bootstrap([correlated(rng, 200, 0.3)], rng)
        hits += interval.low <= 0 <= interval.high
    assert hits >= 0.8 * 60


@pytest.mark.parametrize("averaging", ["sequences", "frames"])
def test_the_interval_lies_around_the_average_that_the_table_prints(averaging) -> None:
    sequences = [np.linspace(0, 1, 30), np.linspace(3, 4, 90)]
    interval = block_bootstrap(sequences, np.random.default_rng(4), averaging)
    assert interval.mean == average(sequences, averaging)
    assert interval.low < interval.mean < interval.high


@pytest.mark.parametrize(("length", "block"), [(1, None), (2, None), (38, None), (50, 7), (50, 50), (50, 80)])
def test_resamples_are_whole_blocks_that_go_round_and_the_last_one_cut(length, block) -> None:
    values = np.random.default_rng(4).normal(5, 2, length)
    size = min(length, block or round(math.sqrt(length)))
    starts = np.random.default_rng(9).integers(0, length, (RESAMPLES, math.ceil(length / size)))
    index = (starts[..., None] + np.arange(size)) % length
    means = values[index.reshape(RESAMPLES, -1)[:, :length]].mean(axis=1)
    found = block_bootstrap([values], np.random.default_rng(9), block=block)
    assert (found.low, found.high) == pytest.approx(tuple(np.quantile(means, [0.025, 0.975])), abs=1e-12)


def test_hours_of_frames_take_no_more_memory_than_a_few_recordings_do() -> None:
    values = np.random.default_rng(5).normal(size=200_000)
    tracemalloc.start()
    try:
        block_bootstrap([values], np.random.default_rng(0))
        assert tracemalloc.get_traced_memory()[1] < 64 << 20
    finally:
        tracemalloc.stop()
