"""The first seconds, under a slider."""

import time

import numpy as np
import pytest

from etnet.errors import Cancelled
from etnet.simulation.preview import VideoPreview
from etnet.simulation.settings import PixelSettings
from etnet.simulation.video import VideoConfig
from tests.simulation.films import drifting, write_film


@pytest.fixture(scope="module")
def preview(tmp_path_factory):
    path = write_film(tmp_path_factory.mktemp("p") / "long.mp4", drifting(120, 2.0, (320, 240)))
    return VideoPreview(path, VideoConfig())


def test_two_seconds_are_previewed_small_enough_to_be_quick(preview):
    recording = preview.recording(VideoConfig(contrast=0.15))
    assert (recording.sensor.width, recording.sensor.height) == (240, 180)
    assert 59 <= len(recording.ground_truth) <= 61
    assert recording.span.stop == pytest.approx(2e6, rel=0.05)
    assert recording.ground_truth.read_frame(3).shape == (180, 240)


def test_another_setting_costs_no_decoding_and_the_same_setting_gives_the_same_events(preview, monkeypatch):
    monkeypatch.setattr("etnet.simulation.motion.cv2.DISOpticalFlow", None)
    monkeypatch.setattr("etnet.simulation.decode.av", None)
    few = preview.events(VideoConfig(contrast=0.4))
    began = time.thread_time()
    many = preview.events(VideoConfig(contrast=0.15))
    assert time.thread_time() - began < 10
    assert len(many) > 1.5 * len(few) > 0
    assert np.array_equal(many.t, preview.events(VideoConfig(contrast=0.15)).t)
    assert len(preview.events(VideoConfig(pixels=PixelSettings(cutoff_hz=10.0)))) > 0


def test_a_preview_can_be_stopped(tmp_path):
    path = write_film(tmp_path / "a.mp4", drifting(10))
    with pytest.raises(Cancelled):
        VideoPreview(path, VideoConfig(), is_cancelled=lambda: True)
