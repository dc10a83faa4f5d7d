"""Recordings for these tests: the real slider_depth, and small made-up ones."""

import io
import zipfile
from functools import cache
from pathlib import Path

import cv2
import h5py
import numpy as np

from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, Recording, recording_of_events
from tests.real_data import real_file


@cache
def slider_depth() -> Recording:
    """The ECD sequence, read plainly; skips the test where the file is absent."""
    sensor = Sensor(240, 180)
    with zipfile.ZipFile(real_file("ecd_slider_depth/slider_depth.zip")) as archive:
        columns = np.loadtxt(io.TextIOWrapper(archive.open("slider_depth/events.txt")))
        lines = [line.split() for line in io.TextIOWrapper(archive.open("slider_depth/images.txt"))]
        frames = [_decode(archive.read(f"slider_depth/{name}")) for _, name in lines]
    t = np.round(columns[:, 0] * 1e6).astype(np.int64)
    p = (2 * columns[:, 3] - 1).astype(np.int8)
    events = Events(columns[:, 1].astype(np.uint16), columns[:, 2].astype(np.uint16), t, p, sensor)
    stamps = np.array([round(float(stamp) * 1e6) for stamp, _ in lines], np.int64)
    return recording_of_events(events, "slider_depth", ground_truth=GroundTruth(stamps, frames.__getitem__))


def made_up(
    name: str = "made_up",
    num_frames: int = 8,
    frame_gap: int = 40_000,
    has_flow: bool = False,
) -> Recording:
    """Frames `frame_gap` µs apart from 1 s on, random events from 1.005 s on; the picture moves 1 px right a frame."""
    sensor = Sensor(48, 40)
    rng = np.random.default_rng(0)
    stop = 1_000_000 + (num_frames - 1) * frame_gap
    t = np.sort(rng.integers(1_005_000, stop, 200 * num_frames))
    x, y = (rng.integers(0, size, len(t)).astype(np.uint16) for size in (sensor.width, sensor.height))
    p = (2 * rng.integers(0, 2, len(t)) - 1).astype(np.int8)
    rows, columns = np.mgrid[: sensor.height, : sensor.width]

    def read_frame(index: int) -> np.ndarray:
        return (0.5 + 0.4 * np.sin((columns - index) / 4) * np.cos(rows / 5)).astype(np.float32)

    def read_flow(index: int) -> np.ndarray:
        return np.stack([np.ones(rows.shape), np.zeros(rows.shape)]).astype(np.float32)

    stamps = 1_000_000 + frame_gap * np.arange(num_frames, dtype=np.int64)
    truth = GroundTruth(stamps, read_frame, read_flow if has_flow else None)
    return recording_of_events(Events(x, y, t, p, sensor), name, ground_truth=truth)


def write_event_utils(recording: Recording, path: Path) -> Path:
    """The recording as an HDF5 file in the event_utils layout."""
    events, truth = recording.read(0, recording.num_events), recording.ground_truth
    with h5py.File(path, "w") as file:
        for name, column in (("xs", events.x), ("ys", events.y), ("ts", events.t / 1e6), ("ps", events.p > 0)):
            file[f"events/{name}"] = column
        file.attrs["sensor_resolution"] = (recording.sensor.height, recording.sensor.width)
        for i in range(len(truth) if truth else 0):
            assert truth is not None
            image = file.create_dataset(
                f"images/image{i:09d}", data=np.round(truth.read_frame(i) * 255).astype(np.uint8)
            )
            image.attrs["timestamp"] = truth.stamps[i] / 1e6
    return path


def _decode(png: bytes) -> np.ndarray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image.astype(np.float32) / 255
