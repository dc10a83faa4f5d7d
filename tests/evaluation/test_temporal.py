"""Warping follows the flow; temporal consistency is zero for a perfect video and blind where truth does not warp."""

import numpy as np
import pytest
import torch

from etnet.evaluation.temporal import estimate_flow, temporal_consistency, warp


def smooth_image(height: int, width: int, shift: float = 0.0) -> torch.Tensor:
    rows, columns = torch.meshgrid(1.0 * torch.arange(height), torch.arange(width) - shift, indexing="ij")
    return (0.5 + 0.4 * torch.sin(columns / 5) * torch.cos(rows / 7))[None, None]


def constant_flow(height: int, width: int, x: float, y: float) -> torch.Tensor:
    return torch.tensor([x, y]).view(1, 2, 1, 1).expand(1, 2, height, width)


def test_zero_flow_is_the_identity() -> None:
    image = torch.rand(2, 1, 45, 60, generator=torch.Generator().manual_seed(0))
    assert torch.allclose(warp(image, torch.zeros(2, 2, 45, 60)), image, atol=2e-5)


def test_the_flow_says_where_each_pixel_came_from() -> None:
    image = torch.rand(1, 1, 20, 30, generator=torch.Generator().manual_seed(1))
    moved = warp(image, constant_flow(20, 30, x=3, y=-2))
    assert torch.allclose(moved[..., :18, 3:], image[..., 2:, :-3], atol=1e-5)
    assert (moved[..., :2] == 0).all()


def slow_consistency(truths: list[np.ndarray], predictions: list[np.ndarray], flow: tuple[int, int]) -> float:
    """The formula pixel by pixel, for whole-pixel flow."""
    height, width = truths[0].shape
    total = 0.0
    for y in range(height):
        for x in range(width):
            j, i = y - flow[1], x - flow[0]
            inside = 0 <= j < height and 0 <= i < width
            carried_truth, carried = (truths[0][j, i], predictions[0][j, i]) if inside else (0.0, 0.0)
            visibility = np.exp(-50 * (truths[1][y, x] - carried_truth) ** 2)
            now = predictions[1][y, x]
            total += visibility * abs(now - carried) / (abs(now) + abs(carried) + 1e-5)
    return total / (height * width)


def test_it_equals_a_slow_twin_written_from_the_formula() -> None:
    rng = np.random.default_rng(2)
    truths, predictions = ([rng.random((9, 12)) for _ in range(2)] for _ in range(2))
    pairs = [(torch.from_numpy(a)[None, None], torch.from_numpy(b)[None, None]) for a, b in (truths, predictions)]
    measured = temporal_consistency(pairs[0], pairs[1], constant_flow(9, 12, 2, 1).double()).item()
    assert measured == pytest.approx(slow_consistency(truths, predictions, (2, 1)), rel=1e-9)


def test_a_video_that_moves_as_the_scene_does_is_consistent() -> None:
    before, after, flow = smooth_image(40, 60), smooth_image(40, 60, shift=2.0), constant_flow(40, 60, 2, 0)
    moving = temporal_consistency((before, after), (before, after), flow).item()
    flickering = temporal_consistency((before, after), (before, after * 1.3), flow).item()
    # What enters at the left edge was nowhere before: its two columns are all that differs.
    assert moving < 0.05 < flickering


def test_it_has_a_gradient_in_the_prediction() -> None:
    before, after = smooth_image(12, 16), smooth_image(12, 16, 1.0)
    prediction = (after * 0.9).requires_grad_()
    temporal_consistency((before, after), (before, prediction), constant_flow(12, 16, 1, 0)).sum().backward()
    assert prediction.grad is not None
    assert prediction.grad.isfinite().all()


def test_the_estimated_flow_points_where_the_picture_went() -> None:
    rng = np.random.default_rng(3)
    coarse = torch.from_numpy(rng.random((1, 1, 20, 26)))
    texture = torch.nn.functional.interpolate(coarse, scale_factor=6, mode="bicubic").clamp(0, 1)[0, 0].numpy()
    before, after = texture[:, 10:130].astype(np.float32), texture[:, 7:127].astype(np.float32)
    flow = estimate_flow(before, after)
    assert np.median(flow[0]) == pytest.approx(3, abs=0.3)
    assert np.median(flow[1]) == pytest.approx(0, abs=0.3)
    carried = warp(torch.from_numpy(before)[None, None], torch.from_numpy(flow)[None])[0, 0].numpy()
    assert np.abs(carried - after)[20:-20, 20:-20].mean() < 0.3 * np.abs(before - after)[20:-20, 20:-20].mean()
