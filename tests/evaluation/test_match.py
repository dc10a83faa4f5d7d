"""Pairs lie within the tolerance, use nothing twice, and follow the offset."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from etnet.evaluation.match import Pair, pair_by_stamp

stamps = st.lists(st.integers(0, 10_000), max_size=30, unique=True).map(sorted)


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(predictions=stamps, frames=stamps, tolerance=st.integers(0, 500), offset=st.integers(-700, 700))
def test_pairs_are_near_and_used_once(predictions, frames, tolerance, offset) -> None:
    pairs = pair_by_stamp(predictions, frames, tolerance, offset)
    assert len({pair.prediction for pair in pairs}) == len({pair.frame for pair in pairs}) == len(pairs)
    for pair in pairs:
        assert pair.lag == frames[pair.frame] + offset - predictions[pair.prediction]
        assert abs(pair.lag) <= tolerance


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(frames=stamps, offset=st.integers(-100_000, 100_000))
def test_equal_stamps_all_pair_up_once_the_offset_is_known(frames, offset) -> None:
    pairs = pair_by_stamp([t + offset for t in frames], frames, tolerance=0, offset=offset)
    assert pairs == [Pair(i, i, 0) for i in range(len(frames))]


def test_the_nearest_wins_and_the_far_frame_stays_alone() -> None:
    assert pair_by_stamp([1_000, 2_000], np.array([1_200, 1_900, 9_000])) == [Pair(0, 0, 200), Pair(1, 1, -100)]
    assert pair_by_stamp([1_000], [900, 1_020]) == [Pair(0, 1, 20)]
    assert pair_by_stamp([], [1, 2]) == []
