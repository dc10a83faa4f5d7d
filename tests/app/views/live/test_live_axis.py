"""The timeline of a live recording: one axis for a whole picture, while events come and leave."""

from app.catalogue.cut import FirstKept, with_cut
from app.html.moment import Moment
from app.html.timeline_marks import AXIS_WIDTH, axis_of, curve_of, place_of
from etnet.events.recording import Span
from etnet.live.buffer import Keep
from etnet.live.recording import LiveRecording
from etnet.live.windows import LiveWindows
from etnet.windows import ByCount
from tests.live.sources import GivenPackets, cut_up, make_events

POLICY = ByCount(50)


def test_places_of_one_picture_are_laid_out_on_one_axis_though_events_leave_meanwhile(monkeypatch):
    monkeypatch.setattr("etnet.live.buffer.BLOCK", 64)
    live, events = LiveRecording(GivenPackets([]), Keep(seconds=1)), make_events(4_000, duration=8_000_000)
    windows = LiveWindows(live, POLICY)

    def moment():
        cut = FirstKept(windows.kept, len(windows.kept))
        recording = with_cut(live.recording(), POLICY, cut, live.extent)
        return Moment("live-1", POLICY, len(cut) - 1, recording, cut)

    for packet in cut_up(events[:2_000], 50):
        live._take(packet)
        windows.take(timeout=0)
    before = moment()
    axis, middle = axis_of(before), int(events.t[1_900])
    place = place_of(before, middle)
    assert 0 < place < AXIS_WIDTH
    assert axis.stop == events.t[1_999]
    for packet in cut_up(events[2_000:], 50):
        live._take(packet)
        windows.take(timeout=0)
    assert axis_of(before) == axis
    assert place_of(before, middle) == place
    later = moment()
    assert isinstance(axis_of(later), Span)
    assert axis_of(later).start > axis.stop, "what has left is no part of the next picture's"
    assert curve_of(later).stamps[0] >= axis_of(later).start
