"""The first seconds of a film, kept for the next setting."""

import time

import numpy as np
import pytest

from etnet.simulation.beginning import Beginning
from etnet.simulation.growing import GrowingVideo
from etnet.simulation.video import VideoConfig
from tests.simulation.films import drifting, write_film
from tests.simulation.test_growing import all_events

SETTINGS = (VideoConfig(contrast=0.15), VideoConfig(contrast=0.3, noise=1.0), VideoConfig(cutoff_hz=30.0))


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    return write_film(tmp_path_factory.mktemp("f") / "long.mp4", drifting(30, 2.0, (64, 48)))


def grown(film, path, config, beginning=None):
    growing = GrowingVideo(film, path, config, "film", beginning=beginning)
    growing.run(lambda: False)
    return growing.recording()


def test_a_film_that_began_from_what_was_kept_is_the_same_to_the_bit(film, tmp_path):
    beginning = Beginning(0.5)
    for number, config in enumerate((*SETTINGS, SETTINGS[0])):
        made = grown(film, tmp_path / f"{number}.h5", config, beginning)
        alone = grown(film, tmp_path / f"{number} alone.h5", config)
        assert beginning.num_frames == 16
        assert np.array_equal(all_events(made), all_events(alone))
        assert np.array_equal(made.ground_truth.stamps, alone.ground_truth.stamps)
        assert made.remarks == alone.remarks


def test_the_pixels_alone_work_on_what_is_kept(film, tmp_path, monkeypatch):
    beginning = Beginning()
    first = grown(film, tmp_path / "first.h5", SETTINGS[0], beginning)
    monkeypatch.setattr("etnet.simulation.motion.cv2.DISOpticalFlow", None)
    began = time.thread_time()
    other = grown(film, tmp_path / "other.h5", SETTINGS[1], beginning)
    assert time.thread_time() - began < 10
    assert first.num_events > 1.2 * other.num_events > 0


def test_what_is_kept_stays_in_its_memory(film, tmp_path):
    beginning = Beginning(most_bytes=150_000)
    for number, config in enumerate(SETTINGS):
        made = grown(film, tmp_path / f"{number}.h5", config, beginning)
        alone = grown(film, tmp_path / f"{number} alone.h5", config)
        assert np.array_equal(all_events(made), all_events(alone))
    assert 0 < beginning.num_frames < 12
    assert beginning._num_bytes <= 150_000
