"""The numbers of every window as CSV: events, polarity, density, frame statistics and, with a camera, the errors."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from etnet.evaluation.lpips import perceptual_distance
from etnet.evaluation.metrics import SSIM_PAPER, mean_squared_error, structural_similarity
from etnet.export.take import IsCancelled, Moment, Progress, Take
from etnet.files import write_atomically

COLUMNS = (
    "window", "t_start_us", "t_stop_us", "seconds", "num_events", "events_per_second", "events_per_pixel", "on_share",
    "active_share", "frame_mean", "frame_std", "camera_stamp_us", "mse", "ssim", "lpips",
)  # fmt: skip
"""In this order; what a recording cannot tell is left empty."""


def window_numbers(moment: Moment) -> dict[str, float | int | None]:
    """One row. Rates are per second, shares 0 … 1; mse and ssim compare the frame, clipped to 0 … 1, with the camera's
    frame nearest to the stamp (SSIM as ET-Net's code computes it), with no matching of brightness.
    """
    window, events, sensor = moment.window, moment.events, moment.recording.sensor
    duration = max(window.t_stop - window.t_start, 1) / 1e6
    pixels = np.unique(events.y.astype(np.int64) * sensor.width + events.x)
    mse, ssim, stamp = camera_errors(moment)
    return {
        "window": window.index,
        "t_start_us": window.t_start,
        "t_stop_us": window.t_stop,
        "seconds": moment.seconds,
        "num_events": window.num_events,
        "events_per_second": window.num_events / duration,
        "events_per_pixel": window.num_events / sensor.num_pixels,
        "on_share": float((events.p > 0).mean()) if len(events) else None,
        "active_share": len(pixels) / sensor.num_pixels,
        "frame_mean": float(moment.frame.mean()),
        "frame_std": float(moment.frame.std()),
        "camera_stamp_us": stamp,
        "mse": mse,
        "ssim": ssim,
    }


def camera_errors(moment: Moment) -> tuple[float | None, float | None, int | None]:
    """MSE and SSIM against the nearest camera frame, and its stamp; `None` without one of the frame's size."""
    truth, pair = moment.recording.ground_truth, _beside_camera(moment)
    if truth is None or pair is None:
        return None, None, None
    stamp = int(truth.stamps[truth.nearest(moment.window.t_stop)])
    is_large = min(pair[1].shape[-2:]) >= SSIM_PAPER.side
    ssim = float(structural_similarity(*pair, SSIM_PAPER)) if is_large else None
    return float(mean_squared_error(*pair)), ssim, stamp


def camera_distance(moment: Moment) -> float | None:
    """LPIPS (AlexNet) of the same pair; `None` without one, or where it is too small. Slow, so asked for by itself."""
    pair = _beside_camera(moment)
    return None if pair is None else perceptual_distance(*pair)


def _beside_camera(moment: Moment) -> tuple[Tensor, Tensor] | None:
    """The frame, clipped to 0 … 1, and the camera's nearest one; `None` without one of the frame's size."""
    camera = moment.camera
    if camera is None or camera.shape != moment.frame.shape:
        return None
    frame = torch.from_numpy(moment.frame.clip(0, 1))[None, None]
    return frame, torch.from_numpy(np.ascontiguousarray(camera))[None, None]


def write_table(
    take: Take, path: Path, progress: Progress | None = None, is_cancelled: IsCancelled | None = None
) -> int:
    """One row a window, six significant digits, whole or not at all."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for moment in take.moments(progress=progress, is_cancelled=is_cancelled):
        numbers = {**window_numbers(moment), "lpips": camera_distance(moment)}
        writer.writerow([_cell(numbers[name]) for name in COLUMNS])
    write_atomically(path, text.getvalue().encode())
    return len(take)


def _cell(value: float | int | None) -> str:
    return "" if value is None else str(value) if isinstance(value, int) else f"{value:.6g}"
