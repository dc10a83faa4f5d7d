"""Laws of window plans: they cover the recording, they are half open, they copy nothing."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import WindowError
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, Growth, recording_of_events
from etnet.windows import (
    BetweenFrames,
    ByActivity,
    ByCount,
    ByCountOrDuration,
    ByDensity,
    ByDuration,
    ByStamps,
    plan_windows,
)
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
    "bad",
    [
        lambda: ByCount(0),
        lambda: ByDuration(0),
        lambda: ByDuration(5, 0),
        lambda: ByDensity(float("nan")),
        lambda: ByStamps(()),
        lambda: ByStamps((5, 5)),
        lambda: ByStamps((1, 2), duration=0),
        lambda: ByStamps((1, 2), duration=5, num_events=5),
        lambda: ByCountOrDuration(0, 5),
        lambda: ByCountOrDuration(5, 0),
        lambda: ByActivity(0.0),
        lambda: ByActivity(1.5),
    ],
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


STAMPS = (10_000, 30_000, 75_000, 100_000)


def test_windows_by_stamps_end_at_each_stamp_and_reach_back_as_stated():
    some = make_events(5_000, duration=100_000)
    recording = recording_of_events(some)
    by_duration = plan_windows(recording, ByStamps(STAMPS, duration=5_000))
    by_count = plan_windows(recording, ByStamps(STAMPS, num_events=300))
    since_the_last = plan_windows(recording, ByStamps(STAMPS))
    for windows in (by_duration, by_count, since_the_last):
        assert [window.t_stop for window in windows] == list(STAMPS)
        for window in windows:
            assert window.stop == np.searchsorted(some.t, window.t_stop)
    assert all(window.t_start == window.t_stop - 5_000 for window in by_duration)
    assert all(window.start == np.searchsorted(some.t, window.t_start) for window in by_duration)
    assert {window.num_events for window in by_count} == {300}
    assert since_the_last[0].start == 0
    assert all(a.stop == b.start and a.t_stop == b.t_start for a, b in itertools.pairwise(since_the_last))


def test_stamps_of_another_clock_are_refused_naming_both():
    recording = recording_of_events(make_events(100, duration=1_000))
    with pytest.raises(WindowError, match="1700000000000000"):
        plan_windows(recording, ByStamps((1_700_000_000_000_000, 1_700_000_000_100_000)))


@given(events(), st.integers(1, 20), st.integers(1_000, 10**6))
def test_whichever_comes_first_ends_a_window(some: Events, count: int, duration: int):
    windows = list(plan_windows(recording_of_events(some), ByCountOrDuration(count, duration)))
    edges = [0, *(window.stop for window in windows)]
    assert [window.start for window in windows] == edges[:-1]
    assert edges[-1] == len(some)
    for window in windows[:-1]:
        assert not window.is_partial
        length = window.t_stop - window.t_start
        assert (window.num_events == count and length < duration) or (window.num_events <= count and length == duration)
    assert all(a.t_stop == b.t_start for a, b in itertools.pairwise(windows))


@pytest.mark.parametrize("block", [7, 1 << 18])
@given(some=events(), share=st.sampled_from([0.001, 0.02, 0.1]))
def test_a_window_by_activity_ends_with_the_pixel_that_makes_its_share(some: Events, share: float, block: int):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("etnet.window_plans._BLOCK", block)
        patch.setattr("etnet.window_plans._SHORTEST_LOOK", 3)
        windows = list(plan_windows(recording_of_events(some), ByActivity(share)))
    wanted = max(1, int(np.ceil(share * some.sensor.num_pixels)))
    edges = [0, *(window.stop for window in windows)]
    assert [window.start for window in windows] == edges[:-1]
    assert edges[-1] == len(some)
    for window in windows:
        part = some[window.start : window.stop]
        places = part.y.astype(np.int64) * some.sensor.width + part.x
        if window.is_partial:
            assert len(np.unique(places)) < wanted
        else:
            assert len(np.unique(places)) == wanted
            assert len(np.unique(places[:-1])) == wanted - 1


GROWING = (
    BetweenFrames(),
    ByCount(70),
    ByDuration(7_000),
    ByDuration(15_000, 4_000),
    ByStamps((20_000, 55_000, 90_000)),
    ByCountOrDuration(100, 9_000),
    ByActivity(0.2),
)


@pytest.mark.parametrize("policy", GROWING)
@pytest.mark.parametrize("takes_over", [False, True])
def test_no_window_of_a_growing_recording_changes_as_it_grows(policy, takes_over: bool):
    some = make_events(1_500, duration=100_000)
    stamps = np.arange(0, 100_001, 10_000)

    def recording_until(t: int):
        truth = GroundTruth(stamps[stamps <= t], lambda i: np.zeros((12, 20), np.float32))
        return recording_of_events(some[: int(np.searchsorted(some.t, t))], ground_truth=truth)

    whole = list(plan_windows(recording_until(100_001), policy))
    former, lengths = None, []
    for t in (20_000, 43_000, 60_000, 98_000):
        part = recording_until(t)
        part = replace(part, latest=lambda part=part: part)
        former = plan_windows(part, policy, former if takes_over else None)
        assert list(former) == whole[: len(former)]
        assert not any(window.is_partial for window in former)
        lengths.append(len(former))
    assert lengths[-1] > lengths[0]


def test_the_first_part_of_a_file_shows_its_full_windows_or_else_what_there_is():
    recording = replace(recording_of_events(make_events(1_000, duration=100_000)), growth=Growth())
    assert [window.stop for window in plan_windows(recording, ByCount(300))] == [300, 600, 900]
    assert [window.stop for window in plan_windows(recording, ByCount(3_000))] == [1_000]
