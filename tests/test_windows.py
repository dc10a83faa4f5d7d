"""Laws of window plans: they cover the recording, they are half open, they copy nothing."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import WindowError
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, plan_windows
from tests.strategies import events, make_events


@given(events(), st.integers(1, 20))
def test_by_count_covers_every_event_once(some: Events, count: int):
    windows = plan_windows(recording_of_events(some), ByCount(count))
    edges = [0, *(window.stop for window in windows)]
    assert [window.start for window in windows] == edges[:-1]
    assert edges[-1] == len(some)
    assert all(window.num_events == count for window in windows[:-1])
    assert all(window.is_partial == (window.num_events < count) for window in windows)


@given(events(), st.integers(1, 10**6).map(lambda d: max(d, 5_000)))
def test_by_duration_covers_every_event_once(some: Events, duration: int):
    windows = list(plan_windows(recording_of_events(some), ByDuration(duration)))
    assert sum(window.num_events for window in windows) == len(some)
    for window in windows:
        inside = (some.t >= window.t_start) & (some.t < window.t_stop)
        assert window.num_events == inside.sum()
        np.testing.assert_array_equal(some.t[window.start : window.stop], some.t[inside])


def test_overlapping_windows_start_a_stride_apart():
    some = make_events(2_000, duration=100_000)
    windows = list(plan_windows(recording_of_events(some), ByDuration(20_000, stride=5_000)))
    assert {b.t_start - a.t_start for a, b in itertools.pairwise(windows)} == {5_000}
    assert all(window.t_stop - window.t_start == 20_000 for window in windows)


def test_density_is_events_per_pixel_of_the_sensor():
    recording = recording_of_events(make_events(1_000, Sensor(20, 12)))
    assert list(plan_windows(recording, ByDensity(0.5))) == list(plan_windows(recording, ByCount(120)))


def test_n_frames_give_n_minus_one_windows_by_their_stamps():
    some = make_events(3_000, duration=100_000)
    stamps = np.array([-5_000, 20_000, 60_000, 100_001], np.int64)
    truth = GroundTruth(stamps, lambda i: np.zeros((12, 20), np.float32))
    windows = list(plan_windows(recording_of_events(some, ground_truth=truth), BetweenFrames()))
    assert [(window.t_start, window.t_stop) for window in windows] == [
        (-5_000, 20_000),
        (20_000, 60_000),
        (60_000, 100_001),
    ]
    assert [window.num_events for window in windows] == [
        int(((some.t >= a) & (some.t < b)).sum()) for a, b in itertools.pairwise(stamps)
    ]


def test_between_frames_without_frames_names_the_way_out():
    with pytest.raises(WindowError, match="ByDuration"):
        plan_windows(recording_of_events(make_events(10)), BetweenFrames())


@pytest.mark.parametrize(
    "bad", [lambda: ByCount(0), lambda: ByDuration(0), lambda: ByDuration(5, 0), lambda: ByDensity(float("nan"))]
)
def test_policies_refuse_nonsense_at_birth(bad):
    with pytest.raises(WindowError):
        bad()


@given(events(), st.integers(-100, 10**6 + 100))
def test_index_at_is_the_first_event_not_earlier(some: Events, offset: int):
    recording = recording_of_events(some)
    t = recording.span.start + offset
    assert recording.index_at(t) == np.searchsorted(some.t, t)


def test_index_at_works_across_blocks():
    some = make_events(300_000, duration=400_000)
    recording = recording_of_events(some)
    for t in np.random.default_rng(0).integers(-10, 400_020, 200):
        assert recording.index_at(int(t)) == np.searchsorted(some.t, t)
