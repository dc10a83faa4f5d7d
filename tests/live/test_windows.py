"""Live windows hold every event once, in step or late; in step they are those of a plan."""

import itertools
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etnet.errors import RecordingError, WindowError
from etnet.events.recording import recording_of_events
from etnet.live import buffer as buffer_module
from etnet.live import windows as windows_module
from etnet.live.buffer import EVENT_BYTES, Keep
from etnet.live.recording import LiveRecording
from etnet.live.windows import KeptWindows, LiveWindows
from etnet.stretch import nearest_window
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, Window, plan_windows
from tests.live.sources import GivenPackets, cut_up, make_events, same, taken_in, wait_for
from tests.strategies import SMALL


def _all_taken(windows: LiveWindows):
    taken = []
    while (window := windows.take(timeout=0)) is not None:
        taken.append(window)
    return taken


@pytest.mark.parametrize("policy", [ByCount(70), ByDensity(0.25), ByDuration(4_000)])
def test_windows_taken_in_step_are_those_of_a_plan(policy):
    events, gate = make_events(1000), threading.Semaphore(0)
    planned = plan_windows(recording_of_events(events), policy)
    with LiveRecording(GivenPackets(cut_up(events, 10), gate=gate)) as live:
        windows = LiveWindows(live, policy)
        for number in range(100):
            gate.release()
            wait_for(lambda number=number: live.extent().num_events == 10 * (number + 1))
            _all_taken(windows)
    assert len(windows.kept) >= 10
    assert windows.num_merged == 0
    for kept, plan in zip(windows.kept, planned, strict=False):
        assert (kept.start, kept.stop, kept.t_start, kept.t_stop) == (plan.start, plan.stop, plan.t_start, plan.t_stop)


@given(
    st.lists(st.integers(1, 120), min_size=1, max_size=20),
    st.lists(st.booleans(), min_size=20, max_size=20),
    st.sampled_from([ByCount(37), ByDuration(1_700), ByDensity(0.1)]),
)
def test_late_windows_are_merged_and_no_event_is_skipped_or_seen_twice(sizes, is_taken, policy):
    events = make_events(sum(sizes))
    live = LiveRecording(GivenPackets([]))
    windows, at = LiveWindows(live, policy), 0
    for size, taken in zip(sizes, is_taken, strict=False):
        live._take(cut_up(events[at : at + size], size)[0])
        at += size
        if taken:
            first = windows.take(timeout=0)
            assert first is None or windows.take(timeout=0) is None, "nothing queues up"
    windows.take(timeout=0)
    kept = list(windows.kept)
    for before, after in itertools.pairwise(kept):
        assert before.stop == after.start
        assert before.t_stop == after.t_start or not isinstance(policy, ByDuration)
    assert not kept or kept[0].start == 0
    for window in kept:
        t = events.t[window.start : window.stop]
        assert len(t) == 0 or (window.t_start <= t[0] and t[-1] <= window.t_stop)


def test_how_many_were_merged_is_counted_and_kept():
    live = taken_in(cut_up(make_events(100), 100))
    windows = LiveWindows(live, ByCount(30))
    window = windows.take(timeout=0)
    assert window is not None
    assert (window.start, window.stop) == (0, 90)
    assert windows.num_merged == 2
    assert windows.kept.num_merged(0) == 3


def test_time_without_events_makes_windows_too():
    live = taken_in([])
    empty, events = make_events(0), make_events(5, duration=100)
    live._take(cut_up(events, 5)[0])
    windows = LiveWindows(live, ByDuration(1_000))
    assert windows.take(timeout=0) is None
    live._take(type(cut_up(events, 5)[0])(empty, until=int(events.t[0]) + 2_500))
    window = windows.take(timeout=0)
    assert window is not None
    assert (window.start, window.stop, window.t_stop - window.t_start) == (0, 5, 2_000)


def test_events_that_left_before_the_network_got_to_them_are_counted(monkeypatch):
    monkeypatch.setattr(buffer_module, "BLOCK", 64)
    events = make_events(2000)
    live = LiveRecording(GivenPackets([]), Keep(num_bytes=4 * 64 * EVENT_BYTES))
    windows = LiveWindows(live, ByCount(50))
    for number, packet in enumerate(cut_up(events, 50)):
        live._take(packet)
        if number == 0:
            assert windows.take(timeout=0) is not None
    window = windows.take(timeout=0)
    assert window is not None
    assert window.start == live.extent().first_held
    assert windows.num_unseen == window.start - 50


def test_a_window_can_be_read_until_the_next_is_taken_though_its_events_leave_meanwhile(monkeypatch):
    monkeypatch.setattr(buffer_module, "BLOCK", 64)
    events = make_events(2000)
    live = LiveRecording(GivenPackets([]), Keep(num_bytes=4 * 64 * EVENT_BYTES))
    windows, at = LiveWindows(live, ByCount(50)), 0
    while at < 2000:
        for packet in cut_up(events[at : at + 200], 50):
            live._take(packet)
        window = windows.take(timeout=0)
        assert window is not None
        for packet in cut_up(events[at + 200 : at + 600], 50):
            live._take(packet)
        assert live.extent().is_there(window.start, window.stop)
        assert same(live.recording().read(window.start, window.stop), events[window.start : window.stop])
        at += 600
    assert not live.extent().is_there(windows.kept[0].start, windows.kept[0].stop)
    with pytest.raises(RecordingError, match="gone"):
        live.recording().read(windows.kept[0].start, windows.kept[0].stop)


def test_many_windows_are_kept_as_they_were():
    live = taken_in([])
    windows = LiveWindows(live, ByCount(1))
    for packet in cut_up(make_events(700), 1):
        live._take(packet)
        windows.take(timeout=0)
    assert len(windows.kept) == 700
    assert [window.start for window in windows.kept[690:]] == list(range(690, 700))
    assert windows.kept[-1].index == 699
    with pytest.raises(IndexError):
        windows.kept[700]


def test_windows_that_overlap_or_go_by_frames_are_refused():
    live = taken_in([])
    for policy in (ByDuration(1000, 500), BetweenFrames()):
        with pytest.raises(WindowError):
            LiveWindows(live, policy)


def test_density_counts_the_pixels_that_the_network_sees():
    from etnet.events.events import Sensor

    live = taken_in(cut_up(make_events(240), 240))
    assert SMALL.num_pixels == 240
    assert np.diff([(w := LiveWindows(live, ByDensity(0.5), Sensor(10, 6)).take(timeout=0)).start, w.stop]) == [240]


def test_windows_that_left_long_ago_are_forgotten_and_the_others_keep_their_numbers(monkeypatch):
    monkeypatch.setattr(windows_module, "GONE", 1_000)
    kept, sizes, held = KeptWindows(), [], 100
    for number in range(50_000):
        window = Window(number, 10 * number, 10 * number + 10, 100 * number, 100 * number + 100)
        kept.append(window, 1 + number % 3, first_held=10 * max(number - held, 0))
        sizes.append(kept.nbytes)
    assert max(sizes[25_000:]) == max(sizes[:25_000]), "nothing grows"
    assert len(kept) == 50_000
    assert 0 < kept.first_known <= 50_000 - 1_000 - held
    for number in (kept.first_known, 49_000, 49_999):
        assert kept[number] == Window(number, 10 * number, 10 * number + 10, 100 * number, 100 * number + 100)
        assert kept.num_merged(number) == 1 + number % 3
    forgotten = kept[17]
    assert (forgotten.index, forgotten.num_events) == (17, 0)
    assert kept[kept.first_known - 1].t_stop == kept[kept.first_known].t_start, "stamps go on ascending"
    assert kept.num_merged(17) == 0
    assert nearest_window(kept, 4_900_060) == 49_000


def test_no_window_that_is_still_held_is_forgotten(monkeypatch):
    monkeypatch.setattr(windows_module, "GONE", 100)
    kept = KeptWindows()
    for number in range(20_000):
        kept.append(Window(number, number, number + 1, number, number + 1), 1, first_held=0)
    assert kept.first_known == 0
    assert kept[3].start == 3
