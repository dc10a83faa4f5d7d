"""A small recording with camera frames and a small network with fixed weights: exports of them take milliseconds."""

import numpy as np
import torch

from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, Recording, recording_of_events
from etnet.export.take import Take
from etnet.nets.etnet import ETNet, ETNetConfig
from etnet.playback.playback import Playback
from etnet.windows import BetweenFrames, plan_windows

SENSOR = Sensor(46, 34)
NUM_WINDOWS = 5
WINDOW_US = 40_000


def made_up_recording(name: str = "made up", sensor: Sensor = SENSOR, num_windows: int = NUM_WINDOWS) -> Recording:
    """Events all over the sensor, 300 a window, and a camera frame at each window's edge."""
    rng = np.random.default_rng(5)
    count = 300 * num_windows
    events = Events(
        rng.integers(0, sensor.width, count).astype(np.uint16),
        rng.integers(0, sensor.height, count).astype(np.uint16),
        np.sort(rng.integers(0, num_windows * WINDOW_US, count)),
        rng.choice(np.array([-1, 1], np.int8), count),
        sensor,
    )
    stamps = np.arange(num_windows + 1, dtype=np.int64) * WINDOW_US
    pictures = rng.random((num_windows + 1, sensor.height, sensor.width), np.float32)
    return recording_of_events(events, name, ground_truth=GroundTruth(stamps, lambda i: pictures[i]))


def made_up_model() -> ETNet:
    """The smallest ET-Net, with random weights that are the same each time."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        model = ETNet(ETNetConfig(base_channels=4, dim=32, heads=2, feed_forward=32, dropout=0.0))
    model.name, model.card = "tiny", {}
    for parameter in model.parameters():
        parameter.requires_grad_(False)
    return model.eval()


def made_up_take(start: int = 0, stop: int | None = None, recording: Recording | None = None) -> Take:
    """A take of the two."""
    recording = recording or made_up_recording()
    return Take.of(Playback(made_up_model(), recording, plan_windows(recording, BetweenFrames())), start, stop)
