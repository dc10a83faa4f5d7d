"""Temporal consistency: does the reconstruction change where the scene does not (Lai et al. 2018, as E2VID uses it)?"""

from __future__ import annotations

import cv2
import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor
from torch.nn.functional import grid_sample

VISIBILITY_SHARPNESS = 50.0
"""α of the visibility weight exp(−α (I₁ − W(I₀))²): 0 where ground truth itself does not warp onto its successor."""
RATIO_EPSILON = 1e-5


def warp(previous: Float[Tensor, "b c h w"], flow: Float[Tensor, "b 2 h w"]) -> Float[Tensor, "b c h w"]:
    """Carry the previous image along the flow: result(x) = previous(x − flow(x)); zero where that lies outside.

    `flow` is the displacement (x, y) in pixels from the previous image to this one, given at this image's pixels.
    Bilinear, with align_corners=True, so that zero flow is the identity.
    """
    height, width = previous.shape[-2:]
    rows = torch.arange(height, device=flow.device, dtype=flow.dtype).view(-1, 1)
    columns = torch.arange(width, device=flow.device, dtype=flow.dtype)
    x = (columns - flow[:, 0]) * (2 / max(width - 1, 1)) - 1
    y = (rows - flow[:, 1]) * (2 / max(height - 1, 1)) - 1
    grid = torch.stack((x, y), dim=-1).to(previous.dtype)
    return grid_sample(previous, grid, mode="bilinear", padding_mode="zeros", align_corners=True)


def temporal_consistency(
    truths: tuple[Tensor, Tensor], predictions: tuple[Tensor, Tensor], flow: Float[Tensor, "b 2 h w"]
) -> Float[Tensor, " b"]:
    """Mean of exp(−50 (I₁ − W(I₀))²) · |P₁ − W(P₀)| / (|P₁| + |W(P₀)| + 1e-5); lower is steadier.

    Each pair is (previous, current), `b 1 h w`; `flow` as in `warp`. Differentiable.
    """
    truth_before, truth = truths
    before, prediction = predictions
    carried_truth, carried = warp(truth_before, flow), warp(before, flow)
    visibility = torch.exp(-VISIBILITY_SHARPNESS * (truth - carried_truth) ** 2)
    change = (prediction - carried).abs() / (prediction.abs() + carried.abs() + RATIO_EPSILON)
    return (visibility * change).mean(dim=(1, 2, 3))


def estimate_flow(
    previous: Float32[np.ndarray, "h w"], current: Float32[np.ndarray, "h w"]
) -> Float32[np.ndarray, "2 h w"]:
    """Flow as `warp` takes it, estimated on two ground-truth frames (0 … 1) by dense inverse search (OpenCV's DIS).

    An estimate, not truth: a table that uses it says so.
    """
    search = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    first, second = (np.round(np.clip(frame, 0, 1) * 255).astype(np.uint8) for frame in (current, previous))
    # From the current frame back to the previous one, so that the vectors lie on the current frame's pixels.
    back = search.calc(first, second, None)  # pyright: ignore[reportArgumentType, reportCallIssue]
    return np.ascontiguousarray(-np.moveaxis(back, -1, 0), dtype=np.float32)
