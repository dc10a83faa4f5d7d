"""A webcam's frames through the simulator: events for everybody."""

import numpy as np
import pytest

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.live.recording import LiveRecording
from etnet.live.simulated import SimulatedSensor
from etnet.live.webcam import MOST_WAITING, PushedFrames
from etnet.simulation.streaming import EventSimulator
from etnet.simulation.video import VideoConfig
from etnet.simulation.walk import Stepping
from tests.live.sources import wait_for
from tests.simulation.known_motion import FRAME_US, KnownScene, voxel_error

SENSOR = Sensor(32, 24)


class Silent:
    """Gives no events."""

    def expose(self, grey, t):
        return Events.empty(SENSOR)


def _frame(shift: int) -> np.ndarray:
    return np.roll(np.tile(np.repeat(np.array([40, 200], np.uint8), 4), 4)[None].repeat(24, 0), shift, 1)


def test_frames_that_move_become_events_with_the_frames_beside():
    source = PushedFrames("webcam 0", SENSOR, SimulatedSensor(VideoConfig(noise=0)))
    with LiveRecording(source) as live:
        for number in range(10):
            source.show(_frame(number), 40_000.0 * number)
            wait_for(lambda number=number: (live.extent().until or 0) >= 40_000 * number and not source._waiting)
        recording = live.wait(100, 60)
        events = recording.read(0, recording.num_events)
        assert (np.diff(events.t) >= 0).all()
        assert set(np.unique(events.p)) == {-1, 1}
        assert recording.ground_truth is not None
        assert recording.ground_truth.stamps[1] == 40_000


def test_frames_that_come_too_fast_are_left_out_and_counted():
    source = PushedFrames("page", SENSOR, Silent())
    for number in range(MOST_WAITING + 3):
        source.show(_frame(number), 1000.0 * number)
    source.close()
    live = LiveRecording(source).start()
    wait_for(lambda: live.is_over)
    assert live.loss.packets == 3


def test_a_frame_of_another_size_is_refused():
    with pytest.raises(RecordingError, match="a frame of 10×10; wanted 32×24"):
        PushedFrames("page", SENSOR, Silent()).show(np.zeros((10, 10), np.uint8), 0.0)


def test_events_follow_the_motion_between_a_webcams_frames():
    scene = KnownScene(4.0, size=(160, 120), num_frames=5)
    errors = []
    for stepping in (None, Stepping("off")):
        pixels = SimulatedSensor(VideoConfig(contrast=0.2, noise=0))
        if stepping is not None:
            pixels._simulator = EventSimulator(VideoConfig(contrast=0.2, noise=0).traits, stepping, threads=1)
        found = [pixels.expose(frame, i * FRAME_US) for i, frame in enumerate(scene.film)]
        assert len(found[0]) == 0
        errors.append(voxel_error(found[1:], scene.true_events))
    assert errors[0] < 0.5 * errors[1]
