"""Events of a video: their laws, on videos that are made up here and written by the exporter."""

import h5py
import numpy as np
import pytest

from etnet.cli.main import main
from etnet.errors import Cancelled, RecordingError
from etnet.events.open import open_recording
from etnet.export.video import video_writer
from etnet.simulation.video import VideoConfig, simulate_video
from etnet.windows import BetweenFrames, plan_windows

WIDTH, HEIGHT, FPS = 64, 48, 50.0


def drifting(num_frames, speed=1.0):
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    return [np.rint(128 + 70 * np.sin((x + speed * i) / 6) * np.cos(y / 7)).astype(np.uint8) for i in range(num_frames)]


def write(path, pictures):
    with video_writer(path, WIDTH, HEIGHT, FPS) as append:
        for picture in pictures:
            append(picture)
    return path


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write(tmp_path_factory.mktemp("videos") / "drift.mp4", drifting(12))


def test_the_events_follow_the_light_to_within_a_threshold(video, tmp_path):
    config = VideoConfig(contrast=0.1, noise=0.0)
    num_events = simulate_video(video, tmp_path / "out.h5", config)
    with open_recording(tmp_path / "out.h5") as recording:
        assert recording.num_events == num_events > 1000
        assert (recording.sensor.width, recording.sensor.height) == (WIDTH, HEIGHT)
        truth = recording.ground_truth
        assert truth is not None
        assert len(truth) == 12
        assert np.allclose(np.diff(truth.stamps), 1e6 / FPS, atol=1)
        events = recording.read(0, num_events)
        summed = np.zeros((HEIGHT, WIDTH))
        np.add.at(summed, (events.y, events.x), events.p)
        first, last = (np.log(truth.read_frame(i).astype(np.float64) ** 2.2 + 0.01) for i in (0, 11))
        # Each pixel begins at a random place between two events, so it may be off by up to one on either side.
        # The video's 220 grey levels are stored as 256: half a step of the darkest pixel is .01.
        assert np.abs(summed * 0.1 - (last - first)).max() <= 2 * 0.1 + 0.01
        assert (np.diff(events.t) >= 0).all()
        assert len(plan_windows(recording, BetweenFrames())) == 11


def test_a_still_scene_gives_no_event_to_an_ideal_sensor_and_some_to_a_noisy_one(tmp_path):
    still = write(tmp_path / "still.mp4", [np.full((HEIGHT, WIDTH), 90, np.uint8)] * 30)
    assert simulate_video(still, tmp_path / "ideal.h5", VideoConfig(noise=0.0)) == 0
    assert simulate_video(still, tmp_path / "noisy.h5", VideoConfig(noise=1.0)) > 100


def test_less_contrast_more_events_and_the_same_seed_the_same_events(video, tmp_path):
    few = simulate_video(video, tmp_path / "few.h5", VideoConfig(contrast=0.4))
    many = simulate_video(video, tmp_path / "many.h5", VideoConfig(contrast=0.1))
    assert many > 2 * few
    assert simulate_video(video, tmp_path / "again.h5", VideoConfig(contrast=0.1)) == many
    with h5py.File(tmp_path / "many.h5") as one, h5py.File(tmp_path / "again.h5") as two:
        for name in ("xs", "ys", "ts", "ps"):
            assert np.array_equal(one[f"events/{name}"], two[f"events/{name}"])


def test_a_slowed_video_is_played_at_its_own_speed_before_the_sensor(video, tmp_path):
    simulate_video(video, tmp_path / "fast.h5", VideoConfig(speed=4.0))
    with open_recording(tmp_path / "fast.h5") as recording:
        assert recording.ground_truth.stamps[-1] == pytest.approx(11 * 1e6 / FPS / 4, abs=1)


def test_large_pictures_are_brought_to_a_size_that_runs(video, tmp_path):
    simulate_video(video, tmp_path / "small.h5", VideoConfig(longest_side=32))
    with open_recording(tmp_path / "small.h5") as recording:
        assert (recording.sensor.width, recording.sensor.height) == (32, 24)


def test_what_is_stopped_or_broken_leaves_nothing(video, tmp_path):
    answers = iter([False, False, True])
    with pytest.raises(Cancelled):
        simulate_video(video, tmp_path / "out.h5", VideoConfig(), is_cancelled=lambda: next(answers))
    (tmp_path / "broken.mp4").write_bytes(b"no video at all")
    for name, said in (("broken.mp4", "cannot be read as a video"), ("missing.mp4", "no such video")):
        with pytest.raises(RecordingError, match=said):
            simulate_video(tmp_path / name, tmp_path / "out.h5", VideoConfig())
    one = write(tmp_path / "one.mp4", drifting(1))
    with pytest.raises(RecordingError, match="events need two"):
        simulate_video(one, tmp_path / "out.h5", VideoConfig())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.mp4", "one.mp4"]


@pytest.mark.parametrize("wrong", [{"contrast": 0.0}, {"noise": -1.0}, {"longest_side": 4}, {"speed": 0.0}])
def test_settings_outside_reason_are_refused(wrong):
    with pytest.raises(RecordingError, match="it takes"):
        VideoConfig(**wrong)


def test_the_command_line_does_it_and_says_what_it_needs(video, tmp_path, capsys):
    out = tmp_path / "drift.h5"
    assert main(["simulate", str(out), "--video", str(video), "--contrast", "0.15"]) == 0
    assert out.is_file()
    assert "events" in capsys.readouterr().err
    assert main(["simulate", str(out)]) == 1
    assert "--photos" in capsys.readouterr().err
