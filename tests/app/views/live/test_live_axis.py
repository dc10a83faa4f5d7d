"""The timeline of a live recording: one axis for a whole picture, while events come and leave."""

from types import SimpleNamespace

import pytest

from app.catalogue.cut import FirstKept, with_cut
from app.html.moment import Moment
from app.html.timeline_marks import AXIS_WIDTH, axis_of, curve_of, place_of
from app.session.channel import parse
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.demo.html import track_html
from app.views.timeline.html import timeline_html
from etnet.events.recording import Span
from etnet.live.buffer import Keep
from etnet.live.recording import LiveRecording
from etnet.live.windows import LiveWindows
from etnet.windows import ByCount
from tests.app.checked_html import Checker
from tests.live.sources import GivenPackets, cut_up, make_events

POLICY = ByCount(50)


@pytest.fixture
def source(monkeypatch):
    """A live source of 8 s that keeps one: `take` gives it events, `moment` is the newest."""
    monkeypatch.setattr("etnet.live.buffer.BLOCK", 64)
    live, events = LiveRecording(GivenPackets([]), Keep(seconds=1)), make_events(4_000, duration=8_000_000)
    windows = LiveWindows(live, POLICY)

    def moment():
        cut = FirstKept(windows.kept, len(windows.kept))
        recording = with_cut(live.recording(), POLICY, cut, live.extent)
        return Moment("live-1", POLICY, len(cut) - 1, recording, cut)

    def take(start, stop):
        for packet in cut_up(events[start:stop], 50):
            live._take(packet)
            windows.take(timeout=0)

    return SimpleNamespace(events=events, take=take, moment=moment)


def test_places_of_one_picture_are_laid_out_on_one_axis_though_events_leave_meanwhile(source):
    source.take(0, 2_000)
    before, events = source.moment(), source.events
    axis, middle = axis_of(before), int(events.t[1_900])
    place = place_of(before, middle)
    assert 0 < place < AXIS_WIDTH
    assert axis.stop == events.t[1_999]
    source.take(2_000, 4_000)
    assert axis_of(before) == axis
    assert place_of(before, middle) == place
    later = source.moment()
    assert isinstance(axis_of(later), Span)
    assert axis_of(later).start > axis.stop, "what has left is no part of the next picture's"
    assert curve_of(later).stamps[0] >= axis_of(later).start


def test_what_is_dragged_along_an_axis_says_the_seconds_that_it_is_dragged_to_wherever_the_axis_begins(source):
    source.take(0, 4_000)
    moment = source.moment()
    axis, first = axis_of(moment), moment.recording.span.start
    assert axis.start - first > 3_000_000
    track = Checker(track_html(moment))
    strip = Checker(timeline_html(moment, state=ViewState(mark_a=axis.start + 9, mark_b=axis.stop - 9)))
    keys = [*track.keys, *(key for key in strip.keys if key.startswith(("span:", "mark:")))]
    assert [key.partition(":")[0] for key in keys] == ["span", "span", "mark", "mark"]
    for share in (0.0, 0.25, 0.5, 1.0):
        there = (axis.start + share * axis.duration - first) / 1e6
        for key in keys:
            assert parse(f"pick|{key}|{share}|0|1", VIEWS).seconds == pytest.approx(there, abs=1e-5)
    slider = track.by_testid("track")[0]
    low, now, high = (float(slider[f"aria-value{name}"]) for name in ("min", "now", "max"))
    assert (low, high) == pytest.approx(((axis.start - first) / 1e6, (axis.stop - first) / 1e6), abs=0.01)
    assert now == pytest.approx(moment.seconds[1], abs=0.01)
