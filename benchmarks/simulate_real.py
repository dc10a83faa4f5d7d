"""Is it like the real thing? A recording's own frames are simulated, and the events lie beside the real ones.

`python benchmarks/simulate_real.py RECORDING …` (recordings with camera frames). Each simulator's thresholds are
brought to where as many ON and OFF events come as in the recording; then rate, polarity, intervals, voxels and what the
bundled network reconstructs (LPIPS to the frames) are compared. "next half": the same settings on frames they were not
tried on.
"""

import sys
from dataclasses import asdict
from pathlib import Path

import cv2
import eventcv
import numpy as np
import torch
from measure import report

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from etnet.evaluation.lpips import load_lpips
from etnet.events.events import Events, Sensor
from etnet.events.open import open_recording
from etnet.events.recording import GroundTruth, Recording, recording_of_events
from etnet.nets.weights import load_model
from etnet.reconstruction import reconstruct
from etnet.simulation.footage import Frame
from etnet.simulation.like import measure_twin, statistics
from etnet.simulation.settings import PixelSettings
from etnet.simulation.tone import Tone
from etnet.simulation.trials import simulated_from_frames, voxel_correlation
from etnet.windows import BetweenFrames

ROUNDS = 6


def rival(frames: list[Frame], pixels: PixelSettings) -> Events:
    """EventCV's events of the same frames; the lag is added, because it has none."""
    pictures = np.stack([Tone("srgb").code(frame.light) for frame in frames])
    seconds = (frames[-1].t - frames[0].t) / 1e6
    found = eventcv.simulate(
        pictures, fps=(len(frames) - 1) / seconds, pos_thres=pixels.pos_thres, neg_thres=pixels.neg_thres,
        sigma_thres=pixels.sigma_thres, cutoff_hz=pixels.cutoff_hz, leak_rate_hz=pixels.leak_rate_hz,
        shot_noise_rate_hz=pixels.shot_noise_rate_hz, refractory_us=int(pixels.refractory_us), upsample="adaptive",
        seed=0,
    ).numpy()  # fmt: skip
    x, y, t, p = found.astype(np.int64)[np.argsort(found[:, 2], kind="stable")].T
    height, width = frames[0].light.shape
    t = t + round(frames[0].t + pixels.lag_us)
    kept = t < frames[-1].t
    signed = np.where(p > 0, 1, -1).astype(np.int8)
    return Events(x[kept].astype(np.uint16), y[kept].astype(np.uint16), t[kept], signed[kept], Sensor(width, height))


def rival_settled(frames: list[Frame], pixels: PixelSettings, real: Events) -> PixelSettings:
    """Its thresholds at the recording's counts, found as ours are."""
    values = asdict(pixels)
    for _ in range(ROUNDS):
        events = rival(frames, PixelSettings(**values))
        for name, sign in (("pos_thres", 1), ("neg_thres", -1)):
            have, want = max(int((events.p == sign).sum()), 1), max(int((real.p == sign).sum()), 1)
            values[name] = float(np.clip(values[name] * (have / want) ** 0.6, 0.02, 4.0))
    return PixelSettings(**values)


def perceived(events: Events, frames: list[Frame], model: torch.nn.Module, judge: torch.nn.Module) -> float | None:
    """Mean LPIPS of the reconstruction to the frames, the first five left out; None where there are no more."""
    stamps = np.array([int(frame.t) for frame in frames], np.int64)
    truth = GroundTruth(stamps, lambda i: np.clip(frames[i].light, 0, 1))
    found = []
    recording = recording_of_events(events, "judged", ground_truth=truth)
    for i, (_, step) in enumerate(reconstruct(model, recording, BetweenFrames())):
        if i >= 5:
            target = torch.from_numpy(np.clip(frames[i + 1].light, 0, 1))[None, None]
            found.append(float(judge(step.frame.float().clamp(0, 1), target)))
    return float(np.mean(found)) if found else None


def frames_of(recording: Recording, half: int) -> list[Frame]:
    """The 25 middle frames, on which a twin is tried, or those after them."""
    truth = recording.ground_truth
    assert truth is not None, f"{recording.name} has no frames"
    inside = np.flatnonzero((truth.stamps >= recording.span.start) & (truth.stamps <= recording.span.stop))
    begin = max(0, (len(inside) - 25) // 2) + (24 * half)
    return [Frame(float(truth.stamps[i]), truth.read_frame(i)) for i in inside[begin : begin + 25]]


def rows_of(path: Path, model: torch.nn.Module, judge: torch.nn.Module) -> list[dict[str, object]]:
    rows = []
    with open_recording(path) as recording:
        twin = measure_twin(recording)
        settings = {"ours": twin.pixels}
        for half, name in enumerate(("tried on", "next half")):
            frames = frames_of(recording, half)
            if len(frames) < (8 if half else 3):
                continue
            edges = np.array([int(frame.t) for frame in frames], np.int64)
            real = recording.read(recording.index_at(int(edges[0])), recording.index_at(int(edges[-1])))
            settings.setdefault("eventcv", rival_settled(frames, twin.pixels, real))
            made = {
                "real": real,
                "ours": simulated_from_frames(settings["ours"], frames),
                "eventcv": rival(frames, settings["eventcv"]),
            }
            for who, events in made.items():
                row: dict[str, object] = {"recording": path.stem, "frames": name, "who": who}
                print(f"{path.stem}, {name}: {who}", flush=True)
                row |= asdict(statistics(events, edges, (edges[-1] - edges[0]) / 1e6))
                row["correlation"] = voxel_correlation(real, events, edges)
                row["lpips"] = perceived(events, frames, model, judge)
                if who in settings:
                    row |= {key: value for key, value in settings[who].as_attributes.items() if value}
                rows.append(row)
    return rows


def main() -> None:
    cv2.setNumThreads(2)
    torch.set_num_threads(2)
    model, judge = load_model("etnet-half", "cpu", "fp32"), load_lpips()
    rows = []
    for path in sys.argv[1:]:
        rows += rows_of(Path(path), model, judge)
        report("simulate_real", rows)  # after each: one takes minutes


if __name__ == "__main__":
    main()
