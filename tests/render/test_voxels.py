import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from etnet.render.colours import GROUND
from etnet.render.voxels import signed_max_pool, voxel_limit, voxel_tiles

grids = arrays(
    np.float32,
    st.tuples(st.just(2), st.integers(1, 9), st.integers(1, 9)),
    elements=st.sampled_from([-2.0, -0.5, 0.0, 0.25, 2.0]),
)


def slow_pool(grid, factor):
    bins, height, width = grid.shape
    out = np.zeros((bins, -(-height // factor), -(-width // factor)), grid.dtype)
    for b in range(bins):
        for row in range(out.shape[1]):
            for column in range(out.shape[2]):
                cell = grid[b, row * factor : (row + 1) * factor, column * factor : (column + 1) * factor].ravel()
                out[b, row, column] = max([*cell, 0.0], key=lambda v: (abs(v), v))
    return out


@given(grids, st.integers(1, 4))
def test_pooling_keeps_the_largest_magnitude_with_its_sign(grid, factor):
    assert np.array_equal(signed_max_pool(grid, factor), slow_pool(grid, factor))


def test_a_single_event_survives_any_shrinking():
    grid = np.zeros((5, 180, 240), np.float32)
    grid[2, 91, 133] = -1.0
    tiles, limit = voxel_tiles(grid, 30)
    assert limit == 1.0
    assert (tiles[2] != GROUND).any(axis=-1).sum() == 1


def test_the_limit_ignores_the_loudest_of_a_thousand():
    grid = np.ones((1, 100, 100), np.float32)
    grid[0, 0, 0] = 500.0
    assert voxel_limit(grid) == 1.0


def test_an_empty_grid_is_dark_and_has_a_limit():
    tiles, limit = voxel_tiles(np.zeros((5, 20, 30), np.float32), 30)
    assert limit == 1.0
    assert (tiles == GROUND).all()


def test_a_given_limit_is_used():
    _, limit = voxel_tiles(np.ones((1, 4, 4), np.float32), 4, limit=3.0)
    assert limit == 3.0
