"""Simulated clips: CPU seconds each, and their events beside a real recording's.

`python benchmarks/simulate.py PHOTOS [CUTOUTS [RECORDING]]`; the recording needs camera frames.
"""

import sys
import time
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from measure import report

from etnet.events.events import Events
from etnet.events.open import open_recording
from etnet.simulation.config import SequenceConfig
from etnet.simulation.pictures import PicturePool
from etnet.simulation.sequence import simulate_sequence

NUM_CLIPS = 100


def statistics(events: Events, index: np.ndarray) -> dict[str, float]:
    """What the windows between the indices look like: events per pixel, active pixels, counts, polarity, gaps."""
    num_pixels = events.sensor.num_pixels
    pixel = events.y.astype(np.int64) * events.sensor.width + events.x
    counts = np.stack([np.bincount(pixel[a:b], minlength=num_pixels) for a, b in pairwise(index)])
    order = np.lexsort((events.t, pixel))
    is_repeat = (np.diff(pixel[order]) == 0) & (np.diff(events.p[order]) == 0)
    gaps = np.diff(events.t[order])[is_repeat]
    return {
        "events_per_pixel": float(counts.mean()),
        "active_share": float((counts > 0).mean()),
        "per_active_pixel_99": float(np.quantile(counts[counts > 0], 0.99)) if counts.any() else 0.0,
        "on_share": float((events.p > 0).mean()) if len(events) else float("nan"),
        "gap_ms_01": float(np.quantile(gaps, 0.01)) / 1000 if len(gaps) else float("nan"),
    }


def simulated(pool: PicturePool, config: SequenceConfig) -> list[dict[str, object]]:
    """Seconds and statistics over many clips."""
    seconds, found, renders = [], [], []
    for seed in range(NUM_CLIPS):
        start = time.process_time()
        clip = simulate_sequence(pool, config, np.random.default_rng(seed))
        seconds.append(time.process_time() - start)
        renders.append(clip.drawn.num_renders)
        found.append(statistics(clip.events, clip.event_index))
    density = np.array([one["events_per_pixel"] for one in found])
    speed: dict[str, object] = {
        "what": f"{config.num_windows} windows of {config.size[1]}×{config.size[0]}",
        "cpu_s_mean": float(np.mean(seconds)),
        "cpu_s_95": float(np.quantile(seconds, 0.95)),
        "frames_per_cpu_s": config.num_windows / float(np.mean(seconds)),
        "renders_mean": float(np.mean(renders)),
    }
    rows = [speed]
    for name, share in (("lower quarter", 0.25), ("median", 0.5), ("upper quarter", 0.75)):
        of_clips = {key: float(np.nanquantile([one[key] for one in found], share)) for key in found[0]}
        rows.append({"what": f"simulated, {name} of clips", **of_clips})
    rows.append(
        {"what": "share of clips at .1–1 events per pixel", "share": float(((density > 0.1) & (density < 1)).mean())}
    )
    return rows


def real(path: Path) -> dict[str, object]:
    """The same of a recording, between its camera's frames."""
    with open_recording(path) as recording:
        events = recording.read(0, recording.num_events)
        assert recording.ground_truth is not None, f"{path} has no camera frames"
        index = np.searchsorted(events.t, recording.ground_truth.stamps)
    return {"what": f"real: {path.stem}", **statistics(events, index)}


def main() -> None:
    cv2.setNumThreads(1)
    photos, *more = (Path(argument) for argument in sys.argv[1:])
    pool = PicturePool.from_folder(photos, more[0] if more else None)
    rows = simulated(pool, SequenceConfig())
    rows += [real(path) for path in more[1:]]
    report("simulate", rows)


if __name__ == "__main__":
    main()
