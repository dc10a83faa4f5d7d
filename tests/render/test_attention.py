import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.render.attention import (
    HIGHEST,
    LOWEST,
    composite,
    dimmed,
    log_level,
    on_grid,
    overlay,
    times_uniform,
    tokens_read,
)


def test_uniform_attention_is_one_everywhere_and_reads_all_tokens():
    row = np.full((3, 690), 1 / 690)
    assert np.allclose(times_uniform(row), 1)
    assert np.allclose(tokens_read(row), 690)


def test_looking_at_one_token_reads_one():
    assert tokens_read(np.eye(690)[7]) == pytest.approx(1)


@given(st.floats(0, 1e6))
def test_levels_stay_in_the_unit_range(relative):
    assert 0 <= log_level(np.array(relative)) <= 1


def test_each_doubling_is_the_same_step():
    levels = log_level(LOWEST * 2.0 ** np.arange(8))
    assert np.allclose(np.diff(levels), 1 / 7)
    assert log_level(np.array(HIGHEST)) == 1


def test_a_range_of_its_own_ends_at_the_largest_value():
    row = np.array([0.1, 0.1, 0.8])
    assert overlay(row, 1, 3, highest=2.4)[0, 2, 3] == overlay(np.array([0.0, 0.0, 1.0]), 1, 3, highest=1.0)[0, 2, 3]


def test_opacity_rises_with_attention_and_nothing_covers_nothing():
    row = np.array([0.0, 0.01, 0.09, 0.9])
    alpha = overlay(row, 2, 2)[..., 3].ravel().astype(int)
    assert alpha[0] == 0
    assert (np.diff(alpha) >= 0).all()


def test_tokens_are_whole_squares_in_their_place_on_the_sensor():
    frame = np.zeros((12, 13), np.uint8)  # padded to 16 × 16: top 2, left 2
    tokens = np.zeros((2, 2, 4), np.uint8)
    tokens[0, 1] = 255
    image = composite(frame, tokens, top=2, left=2, patch=8, query=None)
    assert (image[:6, 6:] == 255).all()
    assert image[6:].sum() == 0
    assert image[:, :6].sum() == 0


def test_without_attention_the_dimmed_frame_shows():
    frame = np.arange(64, dtype=np.uint8).reshape(8, 8) * 3
    image = composite(frame, np.zeros((1, 1, 4), np.uint8), 0, 0, 8, None)
    assert (image == dimmed(frame)[..., None]).all()


def test_the_query_is_marked_where_it_was_asked():
    image = composite(np.zeros((180, 240), np.uint8), np.zeros((23, 30, 4), np.uint8), 2, 0, 8, (100, 50))
    assert (image[50, 100] == 255).all()


def test_the_frame_lies_on_the_grid_at_its_offset():
    padded = on_grid(np.full((12, 13), 9, np.uint8), 2, 2, 2, 2, 8)
    assert padded.shape == (16, 16)
    assert (padded[2:14, 2:15] == 9).all()
    assert padded.sum() == 9 * 12 * 13
