"""Where `eventcv`, a reader of its own making, reads a file too, it finds the same."""

from __future__ import annotations

import eventcv
import numpy as np
import pytest

from etnet.events.open import open_recording
from tests.events.containers import all_events
from tests.events.formats.test_camera_samples import global_shutter, picture, saved, with_events
from tests.real_data import real_file

BOTH_READ = (
    "aedat4/davis346_newtons_cradle_0.5s.aedat4",
    "aedat4/dvxplorer_lite_face_headphones_1.5s.aedat4",
    "prophesee/evt2_640x480_rotating_dot_0.05s.raw",
    "prophesee/evt3_1280x720_night_lights_cut.raw",
    "derived/slider_depth_1.4s_frames.aedat4",
    "derived/davis346_aprilgrid_0.5s.dat",
    "ecd_snippets/dynamic_rotation_snippet.txt",
    "ecd_snippets/shapes_rotation_snippet.txt",
)


@pytest.mark.real
@pytest.mark.parametrize("name", BOTH_READ)
def test_a_second_reader_finds_the_same_events(name):
    path = real_file(name)
    x, y, t, is_on = eventcv.load(str(path)).numpy().T.astype(np.int64)
    with open_recording(path) as recording:
        events = all_events(recording)
    np.testing.assert_array_equal(events.x, x)
    np.testing.assert_array_equal(events.y, y)
    np.testing.assert_array_equal(events.t, t)
    np.testing.assert_array_equal(events.p > 0, is_on > 0)


def test_a_second_reader_finds_the_same_pictures_in_aedat_2(tmp_path):
    """Its pictures take the resets of the one after; with the same resets in all there is no difference."""
    rng = np.random.default_rng(0)
    reset = picture(rng)[0]
    words, _ = with_events(global_shutter([(reset, reset - rng.integers(0, 700, reset.shape)) for _ in range(4)]))
    path = saved(tmp_path / "a.aedat", words)
    theirs = eventcv.read_frames(eventcv.open(str(path)))
    with open_recording(path) as recording:
        assert len(theirs) == 3
        for index, (_, frame) in enumerate(theirs):
            ours = recording.ground_truth.read_frame(index)
            np.testing.assert_allclose(ours, frame.numpy()[0] / 1023, atol=2**-15)


def test_a_second_reader_finds_the_same_motion_in_aedat_2(tmp_path):
    """It takes ±2 g and ±250 °/s for granted, half of jAER's own ranges, which we assume and say."""
    values = np.random.default_rng(1).integers(-(1 << 15), 1 << 15, (200, 7))
    words = [
        (1 << 31 | axis << 28 | (int(value) & 0xFFFF) << 12 | 3 << 10, 1000 * i)
        for i, row in enumerate(values)
        for axis, value in enumerate(row)
    ]
    path = saved(tmp_path / "a.aedat", with_events(np.array(words))[0])
    theirs = eventcv.read_imu(eventcv.open(str(path)))
    with open_recording(path) as recording:
        np.testing.assert_array_equal(recording.inertial.stamps, theirs["t"])
        np.testing.assert_allclose(recording.inertial.acceleration, 2 * theirs["linear_acceleration"] / 9.80665, 1e-5)
        np.testing.assert_allclose(recording.inertial.rotation, 2 * np.rad2deg(theirs["angular_velocity"]), 1e-3)
        assert any("±4 g" in remark.text for remark in recording.remarks)
