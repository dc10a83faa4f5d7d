"""A video that becomes a recording page by page: whatever was shown of it stays true."""

import resource
import threading

import numpy as np
import pytest

from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.events.open import open_recording
from etnet.simulation.growing import FEWEST_FRAMES, GrowingVideo
from etnet.simulation.video import VideoConfig, simulate_video
from etnet.windows import BetweenFrames, ByCount, ByDuration, grown_windows, plan_windows
from tests.simulation.test_video import drifting, write

CONFIG = VideoConfig(contrast=0.15, noise=0.5)


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    return write(tmp_path_factory.mktemp("videos") / "drift.mp4", drifting(24, speed=2.0))


class Steps:
    """Lets a simulation go on by so many frames; asked before each frame is taken in."""

    def __init__(self):
        self.turns, self.asked = threading.Semaphore(0), threading.Semaphore(0)
        self.is_free = False

    def __call__(self):
        if not self.is_free:
            self.asked.release()
            assert self.turns.acquire(timeout=30)
        return False


@pytest.fixture
def stepped(video, tmp_path):
    """A simulation that is held, and how to let it go on by some frames."""
    growing, steps = GrowingVideo(video, tmp_path / "film.h5", CONFIG, "drift"), Steps()
    thread = threading.Thread(target=growing.run, args=(steps,))
    thread.start()
    assert steps.asked.acquire(timeout=30)

    def go_on(frames):
        for _ in range(frames):
            steps.turns.release()
            assert steps.asked.acquire(timeout=30)

    yield growing, go_on
    steps.is_free = True
    steps.turns.release()
    thread.join(30)
    assert not thread.is_alive()


def all_events(recording):
    events = recording.read(0, recording.num_events)
    return np.stack([events.x, events.y, events.t, events.p])


def test_what_has_grown_is_what_the_command_line_makes(video, tmp_path):
    growing = GrowingVideo(video, tmp_path / "film.h5", CONFIG, "drift")
    growing.run(lambda: False)
    grown = growing.wait(lambda: False)
    simulate_video(video, tmp_path / "whole.h5", CONFIG)
    with open_recording(tmp_path / "whole.h5") as whole:
        assert grown.num_events == whole.num_events > 1000
        assert np.array_equal(all_events(grown), all_events(whole))
        assert np.array_equal(grown.ground_truth.stamps, whole.ground_truth.stamps)
        assert np.array_equal(grown.ground_truth.read_frame(7), whole.ground_truth.read_frame(7))
        assert (grown.span, grown.sensor) == (whole.span, whole.sensor)
        for policy in (BetweenFrames(), ByCount(300), ByDuration(7_000, 5_000)):
            assert list(plan_windows(grown, policy)) == list(plan_windows(whole, policy))
    assert grown.latest is None
    assert growing.pace.is_over
    assert growing.pace.done == growing.pace.total == pytest.approx(24 / 50)


@pytest.mark.parametrize("policy", [BetweenFrames(), ByCount(300), ByDuration(7_000), ByDuration(15_000, 4_000)])
def test_a_window_that_was_shown_never_changes(stepped, policy):
    growing, go_on = stepped
    go_on(FEWEST_FRAMES)
    recording, windows, seen = growing.wait(lambda: False), (), []
    for _ in range(4):
        assert recording.latest is not None
        windows = grown_windows(recording, policy, int(recording.ground_truth.stamps[-1]), windows)
        seen.append(([windows[i] for i in range(len(windows))], all_events(recording)))
        go_on(4)
        recording = recording.latest()
    assert len(seen[-1][0]) > len(seen[0][0]) > 0
    final = plan_windows(recording, policy)
    for earlier, events in seen:
        assert earlier == [final[i] for i in range(len(earlier))]
        last = earlier[-1].stop
        assert np.array_equal(events[:, :last], all_events(recording)[:, :last])


def test_nothing_is_made_anew_while_nothing_was_added(stepped):
    growing, go_on = stepped
    go_on(FEWEST_FRAMES)
    held = growing.recording()
    assert growing.recording() is held
    assert held.latest() is held
    go_on(1)
    assert held.latest() is not held
    assert len(held.latest().ground_truth) == len(held.ground_truth) + 1


def test_what_fills_its_place_ends_there_and_says_so(video, tmp_path, monkeypatch):
    monkeypatch.setattr("etnet.simulation.growing.LOOK_AT_SIZE", 6)
    growing = GrowingVideo(video, tmp_path / "film.h5", CONFIG, "drift", largest=1)
    growing.run(lambda: False)
    told = [remark.text for remark in growing.recording().remarks]
    assert len(growing.recording().ground_truth) == 6
    assert any(text.startswith("simulated for 0.1 s only: its events then fill") for text in told)
    assert growing.pace.is_over


def test_a_video_in_which_nothing_can_be_read_or_nothing_moves_is_one_line(tmp_path):
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"nothing of the kind")
    still = write(tmp_path / "still.mp4", [np.full((48, 64), 90, np.uint8)] * 6)
    for path, words in ((broken, "cannot be read as a video"), (still, "nothing moves in it")):
        growing = GrowingVideo(path, tmp_path / "film.h5", VideoConfig(noise=0.0), path.stem)
        growing.run(lambda: False)
        with pytest.raises(RecordingError, match=words) as told:
            growing.wait(lambda: False)
        assert "\n" not in str(told.value)


def test_who_does_not_want_it_any_more_need_not_wait(video, tmp_path):
    growing = GrowingVideo(video, tmp_path / "film.h5", CONFIG, "drift")
    with pytest.raises(Cancelled):
        growing.wait(lambda: True)
    growing.run(lambda: True)
    assert growing.pace.is_over


def test_a_disk_that_fills_up_ends_a_simulation_with_a_sentence_and_no_crash(video, tmp_path):
    growing = GrowingVideo(video, tmp_path / "film.h5", CONFIG, "drift")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, before[1]))
    try:
        growing.run(lambda: False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert growing.pace.is_over
    try:
        said = str(growing.recording().remarks[-1])
    except EtnetError as error:
        said = str(error)
    assert "cannot be written" in said
