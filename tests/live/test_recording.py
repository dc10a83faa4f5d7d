"""A live recording grows, says what was lost, and runs on one clock."""

import threading

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.live.clock import RESUME_GAP, OneWayClock
from etnet.live.recording import LiveRecording
from etnet.live.source import Packet, Setting
from etnet.windows import ByCount, grown_windows
from tests.live.sources import GivenPackets, cut_up, frames_at, make_events, same, taken_in, wait_for


def test_it_grows_and_is_the_same_object_while_nothing_was_added():
    gate, events = threading.Semaphore(0), make_events(300)
    with LiveRecording(GivenPackets(cut_up(events, 100), gate=gate)) as live:
        gate.release()
        first = live.wait(100)
        assert live.recording() is first
        assert first.num_events == 100
        assert first.latest is not None
        gate.release(2)
        wait_for(lambda: live.is_over)
        last = first.latest()
        assert last.num_events == 300
        assert last.latest is None, "nothing more will come"
        assert first.num_events == 100, "what was handed out stays as it was"
        assert same(last.read(0, 300), events)
        assert last.span == (events.t[0], events.t[-1])


def test_its_settled_windows_are_those_of_the_whole():
    events = make_events(450)
    recording = taken_in(cut_up(events, 90)).recording()
    assert len(grown_windows(recording, ByCount(100), int(events.t[-1]))) == 4


def test_it_is_taken_for_a_growing_recording_of_the_library():
    recording = taken_in([Packet(make_events(50), frames=frames_at([1000, 2000]))]).recording()
    assert recording.ground_truth is not None
    assert list(recording.ground_truth.stamps) == [1000, 2000]
    assert "live from given" in str(recording.remarks[0])


def test_losses_notes_and_settings_are_counted_and_kept():
    events = make_events(20)
    packets = [
        Packet(events[:10], num_lost=3, notes=("a cable",)),
        Packet(events[10:], num_lost=1, changed=(Setting("diff_on", 7, 0, 9),)),
    ]
    live = taken_in(packets)
    assert live.loss.packets == 4
    assert [note.text for note in live.notes] == ["a cable", "diff_on is 7 now"]
    assert live.notes[1].setting == Setting("diff_on", 7, 0, 9)
    assert live.notes_from(1) == (2, live.notes[1:])


def test_a_source_that_fails_is_one_sentence_and_what_came_stays():
    class Failing(GivenPackets):
        def packets(self, is_stopped):
            yield from super().packets(is_stopped)
            raise KeyError("inside")

    live = LiveRecording(Failing(cut_up(make_events(40), 40))).start()
    wait_for(lambda: live.is_over)
    assert "given: ended by a fault of its own (KeyError" in live.notes[0].text
    assert live.recording().num_events == 40


def test_waiting_for_what_does_not_come_ends_with_a_sentence():
    live = taken_in([])
    with pytest.raises(RecordingError, match="0 of 1 events"):
        live.wait(1, timeout=0.1)


def test_stopping_ends_the_thread_and_gives_the_source_back():
    source = GivenPackets(cut_up(make_events(10), 1), gate=threading.Semaphore(0))
    live = LiveRecording(source).start()
    live.stop()
    wait_for(lambda: live.is_over)
    assert source.is_closed


def test_a_clock_that_jumps_ahead_goes_on_and_is_said():
    clock = OneWayClock()
    clock.mended(_stamped([0, 100]))
    mended = clock.mended(_stamped([10**15, 10**15 + 5]))
    assert list(mended.packet.events.t) == [100 + RESUME_GAP, 105 + RESUME_GAP]
    assert "jumped ahead by 1000000000 s" in mended.packet.notes[0]


def test_how_far_behind_a_moment_is():
    gate, events = threading.Semaphore(0), make_events(200)
    with LiveRecording(GivenPackets(cut_up(events, 100), gate=gate)) as live:
        gate.release(2)
        live.wait(200)
        wait_for(lambda: live.behind(int(events.t[50])) is not None)
        behind, later = live.behind(int(events.t[50])), live.behind(int(events.t[50]))
        assert behind is not None
        assert later is not None
        assert 0 <= behind <= later
        assert live.behind(int(events.t[-1]) + 1) is None, "it has not come yet"


def _stamped(stamps, notes=()):
    events = make_events(len(stamps))
    return Packet(type(events)(events.x, events.y, np.array(stamps, np.int64), events.p, events.sensor), notes=notes)


def test_events_that_overtake_each_other_are_held_up_and_counted():
    clock = OneWayClock()
    assert clock.mended(_stamped([10, 20, 15, 30])).num_held_up == 1
    mended = clock.mended(_stamped([25, 40]))
    assert list(mended.packet.events.t) == [30, 40]
    assert mended.num_held_up == 1
    assert mended.packet.notes == ()


def test_a_clock_that_begins_again_goes_on_and_is_said():
    clock = OneWayClock()
    clock.mended(_stamped([0, 5_000_000]))
    mended = clock.mended(_stamped([100, 200]))
    assert list(mended.packet.events.t) == [5_000_000 + RESUME_GAP, 5_000_000 + RESUME_GAP + 100]
    assert "the clock went back by 5.000 s" in mended.packet.notes[0]
    assert list(clock.mended(_stamped([300])).packet.events.t) == [5_000_000 + RESUME_GAP + 200]
