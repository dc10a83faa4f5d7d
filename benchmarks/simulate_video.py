"""Films of 30 frames a second against scenes whose every moment is known: ours beside EventCV, in the same run.

`python benchmarks/simulate_video.py [PHOTO …]` (names of scikit-image's photos; default coffee). Each simulator is
judged against itself on all moments of the scene: EventCV's pixels differ from ours, its own truth does not.
"""

import sys
import time
from pathlib import Path

import cv2
import numpy as np
from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import eventcv

from etnet.events.events import Events, Sensor
from etnet.simulation.tone import Tone
from etnet.simulation.walk import Stepping
from tests.simulation.known_motion import FRAME_US, MOMENTS, KnownScene, by_frame, voxel_error

SPEEDS = (1.7, 4.0, 10.0)


def rival(frames: np.ndarray, fps: float, sensor: Sensor, upsample: str) -> Events:
    """EventCV's events of frames, with an ideal sensor of our thresholds."""
    found = eventcv.simulate(
        frames, fps=fps, pos_thres=0.2, neg_thres=0.2, sigma_thres=0.0, cutoff_hz=0.0, leak_rate_hz=0.0,
        shot_noise_rate_hz=0.0, refractory_us=0, upsample=upsample, seed=0,
    )  # fmt: skip
    columns = found.numpy().astype(np.int64)
    x, y, t, p = columns[np.argsort(columns[:, 2], kind="stable")].T
    signed = np.where(p > 0, 1, -1).astype(np.int8)
    return Events(x.astype(np.uint16), y.astype(np.uint16), t.astype(np.int64), signed, sensor)


def judged(scene: KnownScene) -> dict[str, object]:
    """Errors, event counts and speed of each on one scene."""
    row: dict[str, object] = {
        "photo": scene.photo, "size": f"{scene.size[0]}x{scene.size[1]}", "px_a_frame": scene.speed,
        "disc": scene.has_disc,
    }  # fmt: skip
    true = scene.true_events
    row["events_per_pixel_frame"] = sum(map(len, true)) / len(true) / true[0].sensor.num_pixels
    for name, stepping in (("straight", Stepping("off")), ("ours", Stepping("auto"))):
        began, spent = time.perf_counter(), time.process_time()
        found = scene.simulated(stepping)
        row[f"{name}_fps"] = len(found) / (time.perf_counter() - began)
        row[f"{name}_frames_per_cpu_s"] = len(found) / (time.process_time() - spent)
        row[f"{name}_error"] = voxel_error(found, true)
        row[f"{name}_count"] = sum(map(len, found)) / sum(map(len, true))
    sensor = true[0].sensor
    every = np.stack([Tone("srgb").code(light) for light in scene.moments()])
    rival_true = by_frame(rival(every, MOMENTS * 1e6 / FRAME_US, sensor, "off"), scene.num_frames)
    began, spent = time.perf_counter(), time.process_time()
    events = rival(np.stack(scene.film), 1e6 / FRAME_US, sensor, "adaptive")
    row["eventcv_fps"] = (scene.num_frames - 1) / (time.perf_counter() - began)
    row["eventcv_frames_per_cpu_s"] = (scene.num_frames - 1) / (time.process_time() - spent)
    found = by_frame(events, scene.num_frames)
    row["eventcv_error"] = voxel_error(found, rival_true)
    row["eventcv_count"] = len(events) / max(sum(map(len, rival_true)), 1)
    return row


def main() -> None:
    photos = sys.argv[1:] or ["coffee"]
    cv2.setNumThreads(2)
    rows = [
        judged(KnownScene(speed, has_disc, size, photo=photo))
        for photo in photos
        for has_disc in (False, True)
        for size in ((160, 120), (240, 180))
        for speed in SPEEDS
    ]
    report("simulate_video", rows)


if __name__ == "__main__":
    main()
