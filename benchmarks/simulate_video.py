"""Films of 30 frames a second against scenes whose every moment is known: ours beside EventCV, in the same run.

`python benchmarks/simulate_video.py [PHOTO …]` (names of scikit-image's photos; default coffee). Each simulator is
judged against itself on all moments of the scene: EventCV's pixels differ from ours, its own truth does not. Ours is
`EventSimulator.run` with two threads; each is the fastest of three runs. `…_fps` is wall time, to which a busy machine
adds; `…_frames_per_cpu_s` counts the processor seconds of all threads, `…_own_thread_share` is how much of them the
calling thread took: below a half two free cores are both busy all the time.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

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
RUNS = 3

T = TypeVar("T")


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


def timed(row: dict[str, object], name: str, num_frames: int, call: Callable[[], T]) -> T:
    """The answer of a call; its frames a second, of wall and of processor, go into the row."""
    walls, spents, owns = [], [], []
    for _ in range(RUNS):
        began, spent, own = time.perf_counter(), time.process_time(), time.thread_time()
        found = call()
        walls.append(time.perf_counter() - began)
        spents.append(time.process_time() - spent)
        owns.append(time.thread_time() - own)
    row[f"{name}_fps"], row[f"{name}_frames_per_cpu_s"] = num_frames / min(walls), num_frames / min(spents)
    row[f"{name}_own_thread_share"] = min(own / spent for own, spent in zip(owns, spents, strict=True))
    return found  # pyright: ignore[reportPossiblyUnboundVariable]


def judged(scene: KnownScene) -> dict[str, object]:
    """Errors, event counts and speed of each on one scene."""
    row: dict[str, object] = {
        "photo": scene.photo, "size": f"{scene.size[0]}x{scene.size[1]}", "px_a_frame": scene.speed,
        "disc": scene.has_disc,
    }  # fmt: skip
    true = scene.true_events
    row["events_per_pixel_frame"] = sum(map(len, true)) / len(true) / true[0].sensor.num_pixels
    for name, stepping in (("straight", Stepping("off")), ("ours", Stepping("auto"))):
        found = timed(row, name, scene.num_frames - 1, lambda stepping=stepping: scene.simulated(stepping, threads=2))
        row[f"{name}_error"] = voxel_error(found, true)
        row[f"{name}_count"] = sum(map(len, found)) / sum(map(len, true))
    sensor = true[0].sensor
    every = np.stack([Tone("srgb").code(light) for light in scene.moments()])
    rival_true = by_frame(rival(every, MOMENTS * 1e6 / FRAME_US, sensor, "off"), scene.num_frames)
    film = np.stack(scene.film)
    events = timed(row, "eventcv", scene.num_frames - 1, lambda: rival(film, 1e6 / FRAME_US, sensor, "adaptive"))
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
