"""A bounded buffer in which events keep their numbers; what left it is an error, never another event."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.errors import RecordingError
from etnet.live import buffer as module
from etnet.live.buffer import EVENT_BYTES, Keep, LiveBuffer
from etnet.live.source import CameraFrame, no_triggers
from tests.live.sources import cut_up, edges_at, frames_at, make_events, same, taken_in
from tests.strategies import SMALL

NONE = no_triggers()


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(module, "BLOCK", 64)


def _filled(events, keep, size=50):
    buffer = LiveBuffer(SMALL, keep)
    for packet in cut_up(events, size):
        buffer.add(packet.events, None, (), NONE)
    return buffer


def test_what_came_is_read_back_at_any_place(small_blocks):
    events = make_events(1000)
    buffer = _filled(events, Keep())
    for start, stop in ((0, 1000), (0, 0), (63, 65), (64, 128), (999, 1000), (10, 700)):
        assert same(buffer.read(start, stop), events[start:stop])


def test_what_left_the_buffer_is_an_error_that_names_the_moment(small_blocks):
    events = make_events(1000, duration=10_000_000)
    buffer = _filled(events, Keep(seconds=2))
    extent = buffer.extent()
    assert 0 < extent.first_held < 1000
    assert extent.gone_before == events.t[extent.first_held]
    assert same(buffer.read(extent.first_held, 1000), events[extent.first_held :])
    with pytest.raises(RecordingError, match=r"gone: what came before [78]\.\d s has left the buffer"):
        buffer.read(extent.first_held - 1, 1000)
    with pytest.raises(RecordingError, match="is gone"):
        buffer.bracket(int(events.t[0]), 1000)


def test_a_byte_budget_is_never_exceeded(small_blocks):
    keep = Keep(num_bytes=8 * 64 * EVENT_BYTES)
    buffer = LiveBuffer(SMALL, keep)
    events = make_events(5000)
    for number, packet in enumerate(cut_up(events, 30)):
        frames = frames_at([int(packet.events.t[0])]) if number % 7 == 0 else ()
        buffer.add(packet.events, None, frames, NONE)
        assert buffer.nbytes <= keep.num_bytes
    assert same(buffer.read(4990, 5000), events[4990:])


def test_only_what_is_too_old_leaves(small_blocks):
    events = make_events(2000, duration=4_000_000)
    buffer = _filled(events, Keep(seconds=1))
    held = buffer.extent().first_held
    assert events.t[held] <= events.t[-1] - 1_000_000, "a whole second is held"
    assert held >= np.searchsorted(events.t, events.t[-1] - 1_000_000) - 64, "and at most a block more"


def test_frames_and_triggers_keep_their_numbers_and_leave_with_their_time():
    buffer = LiveBuffer(SMALL, Keep(seconds=1))
    frames = frames_at(range(0, 3_000_000, 100_000))
    for frame in frames:
        buffer.add(make_events(0), frame.stamp, (frame,), edges_at([frame.stamp]))
    truth = buffer.truth()
    assert truth is not None
    assert len(truth) == 30
    assert np.array_equal(np.rint(truth.read_frame(29) * 255).astype(np.uint8), frames[29].pixels)
    with pytest.raises(RecordingError, match="camera frame 3 is gone"):
        truth.read_frame(3)
    start, held = buffer.frames_from(0)
    assert [frame.stamp for frame in held] == [frame.stamp for frame in frames[start:]]
    start, triggers = buffer.triggers_from(0)
    assert start == 30 - len(triggers)
    assert triggers.stamps[-1] == frames[-1].stamp


def test_stamps_of_frames_that_left_long_ago_are_forgotten_and_no_truth_reads_another_frame(monkeypatch):
    monkeypatch.setattr(module, "STAMPS", 500)
    buffer, sizes = LiveBuffer(SMALL, Keep(seconds=1)), []
    (frame,) = frames_at([0])
    for number in range(20_000):
        stamp = number * 10_000
        pixels = np.full_like(frame.pixels, number % 251)
        buffer.add(make_events(0), stamp, (CameraFrame(stamp, pixels),), NONE)
        sizes.append(len(buffer._frame_stamps))
        if number == 9_999:
            earlier = buffer.truth()
    assert max(sizes[10_000:]) == max(sizes[:10_000]), "nothing grows"
    truth = buffer.truth()
    assert truth is not None
    assert len(truth) < 2_000
    assert (np.diff(truth.stamps) == 10_000).all()
    assert truth.stamps[-1] == 199_990_000
    for place in (len(truth) - 1, len(truth) - 90):
        number = int(truth.stamps[place]) // 10_000
        assert np.rint(truth.read_frame(place) * 255).max() == number % 251
    with pytest.raises(RecordingError, match="camera frame 3 is gone"):
        truth.read_frame(3)
    assert earlier.stamps[-1] == 99_990_000, "what was handed out stays as it was"
    with pytest.raises(RecordingError, match="is gone"):
        earlier.read_frame(len(earlier) - 1)


def test_triggers_by_the_thousand_are_held_in_few_pieces_and_those_beyond_the_most_leave(monkeypatch):
    monkeypatch.setattr(module, "MOST_TRIGGERS", 3_000)
    buffer, stamps = LiveBuffer(SMALL, Keep()), list(range(0, 5_000_000, 1_000))
    for stamp in stamps:
        buffer.add(make_events(0), stamp, (), edges_at([stamp]))
    start, held = buffer.triggers_from(0)
    assert start + len(held) == 5_000
    assert 2_000 <= len(held) <= 3_000
    assert list(held.stamps) == stamps[start:]
    assert len(buffer._triggers) <= 4


@given(st.lists(st.integers(0, 400), min_size=1, max_size=400), st.integers(1, 90), st.integers(-5, 405))
@settings(max_examples=60)
def test_the_first_event_from_a_moment_on_is_found_as_in_a_plain_recording(stamps, size, t):
    events = make_events(len(stamps))
    events = type(events)(events.x, events.y, np.array(sorted(stamps), np.int64), events.p, events.sensor)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "BLOCK", 64)
        recording = taken_in(cut_up(events, size)).recording()
        assert recording.index_at(t) == np.searchsorted(events.t, t)


def test_a_snapshot_stays_what_it_was_while_more_comes(small_blocks):
    events = make_events(600)
    buffer = _filled(events[:300], Keep())
    before = buffer.read(250, 300)
    copied = type(before)(before.x.copy(), before.y.copy(), before.t.copy(), before.p.copy(), before.sensor)
    for packet in cut_up(events[300:], 20):
        buffer.add(packet.events, None, (), NONE)
    assert same(before, copied)


def test_too_little_cannot_be_kept():
    with pytest.raises(RecordingError, match="MB are too few"):
        Keep(num_bytes=10)
    with pytest.raises(RecordingError, match="cannot be kept"):
        Keep(seconds=0)
