"""Real files open with the counts that are known of them, and one recording is the same in every container."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from etnet.events.open import Assumptions, open_recording
from tests.events.containers import COUNTS, SAME_FRAMES, SAME_RECORDING, all_events, assert_same_events
from tests.real_data import real_file

pytestmark = pytest.mark.real


@pytest.mark.parametrize("name", COUNTS)
def test_a_file_opens_with_its_counts_and_its_columns_obey_the_contract(name):
    size, num_events, num_frames = COUNTS[name]
    with open_recording(real_file(name)) as recording:
        events = all_events(recording)
        assert (recording.sensor.width, recording.sensor.height) == size
        assert len(events) == recording.num_events == num_events
        assert [column.dtype for column in (events.x, events.y, events.t, events.p)] == ["u2", "u2", "i8", "i1"]
        assert (np.diff(events.t) >= 0).all()
        assert (np.abs(events.p) == 1).all()
        if num_events:
            assert (int(events.t[0]), int(events.t[-1])) == recording.span
            assert recording.index_at(recording.span.start) == 0
        truth = recording.ground_truth
        assert (0 if truth is None else len(truth)) == num_frames
        for i in range(num_frames):
            frame = truth.read_frame(i)
            assert frame.dtype == np.float32
            assert frame.shape == (size[1], size[0])
            assert 0 <= frame.min() <= frame.max() <= 1


@pytest.mark.parametrize(("longest", "part"), [(row[0], part) for row in SAME_RECORDING for part in row[1:]])
def test_containers_of_one_recording_agree_column_by_column(longest, part):
    with open_recording(real_file(longest)) as whole, open_recording(real_file(part)) as piece:
        events = all_events(piece)
        assert_same_events(whole.read(0, len(events)), events)


def test_evt21_holds_the_same_events_up_to_the_order_within_one_word():
    with (
        open_recording(real_file(SAME_RECORDING[1][0])) as whole,
        open_recording(real_file("derived/davis346_aprilgrid_0.3s_evt21.raw")) as part,
    ):
        found = all_events(part)
        expected = whole.read(0, len(found))
        np.testing.assert_array_equal(found.t - found.t[0], expected.t - expected.t[0])
        columns = [np.stack([e.t - e.t[0], e.y, e.x, e.p]) for e in (found, expected)]
        ordered = [table[:, np.lexsort(table[::-1])] for table in columns]
        np.testing.assert_array_equal(*ordered)


@pytest.mark.parametrize("part", SAME_FRAMES)
def test_containers_of_one_recording_have_the_same_frames_at_the_same_moments(part):
    with open_recording(real_file(SAME_RECORDING[0][0])) as whole, open_recording(real_file(part)) as piece:
        expected, found = whole.ground_truth, piece.ground_truth
        shift = whole.span.start - piece.span.start
        np.testing.assert_array_equal(found.stamps + shift, expected.stamps[: len(found)])
        for i in range(0, len(found), 5):
            np.testing.assert_array_equal(found.read_frame(i), expected.read_frame(i))


def test_the_first_frame_of_slider_depth_precedes_its_first_event():
    with open_recording(real_file("ecd_slider_depth/slider_depth.zip")) as recording:
        assert recording.ground_truth.stamps[0] == 0
        assert recording.span.start == 3811


@pytest.mark.parametrize("name", ["derived/slider_depth_1.0s_event_utils.h5", "derived/dvxplorer_lite_face1_dsec.h5"])
def test_slices_equal_the_whole_from_many_threads(name):
    rng = np.random.default_rng(0)
    with open_recording(real_file(name)) as recording, ThreadPoolExecutor(4) as pool:
        whole = all_events(recording)
        pairs = np.sort(rng.integers(0, recording.num_events + 1, (40, 2)), axis=1)
        parts = pool.map(lambda pair: recording.read(int(pair[0]), int(pair[1])), pairs)
        for (start, stop), part in zip(pairs, parts, strict=True):
            for name_of in ("x", "y", "t", "p"):
                np.testing.assert_array_equal(getattr(part, name_of), getattr(whole, name_of)[start:stop])


def test_what_was_taken_for_granted_is_said():
    with open_recording(real_file("prophesee/evt2_640x480_rotating_dot_0.05s.raw")) as recording:
        assert any(remark.kind == "assumed" and "640×480" in remark.text for remark in recording.remarks)


def test_a_stated_sensor_wins_and_is_said():
    path = real_file("ecd_snippets/boxes_rotation_snippet.txt")
    with open_recording(path, assume=Assumptions(width=640, height=480)) as recording:
        assert str(recording.sensor) == "640×480"
        assert any("as stated" in remark.text for remark in recording.remarks)
