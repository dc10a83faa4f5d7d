from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import nn

from etnet.evaluation.lpips import load_lpips
from etnet.nets.presets import build_model
from etnet.simulation.config import SceneConfig, SequenceConfig
from etnet.simulation.sequence import simulate_sequence
from etnet.training.config import LossConfig
from etnet.training.data import procedural_pool
from etnet.training.losses import (
    Pairs,
    drives_of,
    gradient_l1,
    score,
    silence,
    temporal_consistency,
    warp,
    without_tone,
)


@pytest.fixture
def images() -> torch.Tensor:
    return torch.rand(2, 1, 40, 48, generator=torch.Generator().manual_seed(1))


def test_no_flow_changes_nothing(images: torch.Tensor):
    assert torch.allclose(warp(images, torch.zeros(2, 2, 40, 48)), images, atol=1e-5)


def test_a_flow_of_whole_pixels_shifts(images: torch.Tensor):
    flow = torch.zeros(2, 2, 40, 48)
    flow[:, 0], flow[:, 1] = 3.0, -2.0
    warped = warp(images, flow)
    assert torch.allclose(warped[..., :38, 3:], images[..., 2:, :-3], atol=1e-4)


def test_the_simulators_flow_carries_each_frame_into_the_next():
    scene = SceneConfig(num_objects=(0, 0), static_camera_share=0.0, smooth_share=0.0)
    config = SequenceConfig(size=(64, 64), num_windows=6, scene=scene)
    clip = simulate_sequence(procedural_pool(np.random.default_rng(0), 4), config, np.random.default_rng(2))
    frames, flow = torch.from_numpy(clip.frames)[:, None], torch.from_numpy(clip.flow)
    inner = (..., slice(16, -16), slice(16, -16))
    moved = (warp(frames[:-1], flow[1:]) - frames[1:])[inner].abs().mean()
    still = (frames[:-1] - frames[1:])[inner].abs().mean()
    assert moved < 0.25 * still


def test_consistency_is_zero_for_a_prediction_that_moves_along(images: torch.Tensor):
    flow = torch.full((2, 2, 40, 48), 1.7)
    after = warp(images, flow)
    assert temporal_consistency(images, after, images, after, flow) < 1e-6
    assert temporal_consistency(images, images, images, after, flow) > 0.05


def test_consistency_follows_its_equation(images: torch.Tensor):
    still = torch.zeros(1, 2, 40, 48)
    before, after = images[:1], images[1:]
    truth_before, truth_after = before * 0.5, after * 0.7
    mask = torch.exp(-50 * (truth_after - truth_before) ** 2)
    expected = (mask * (after - before).abs() / (after.abs() + before.abs() + 1e-5)).mean()
    got = temporal_consistency(before, after, truth_before, truth_after, still)
    assert torch.allclose(got, expected, atol=1e-5)


def test_a_constant_offset_has_no_gradient_error(images: torch.Tensor):
    assert gradient_l1(images + 0.3, images) < 1e-6


def test_the_total_is_the_weighted_sum_of_the_terms(images: torch.Tensor):
    config = LossConfig(perceptual=0.7, l1=0.2, gradient=0.4, tone=0.3, context=0.6, alive=0.1, temporal=0.5)
    pairs = Pairs(torch.tensor([0]), torch.tensor([1]), torch.zeros(1, 2, 40, 48))
    terms = score(images, images.flip(0), config, load_lpips(), pairs, torch.tensor(0.25), torch.tensor(2.0))
    expected = 0.7 * terms.perceptual + 0.2 * terms.l1 + 0.4 * terms.gradient + 0.3 * terms.tone
    expected = expected + 0.6 * 0.25 + 0.1 * 2 + 0.5 * terms.temporal
    assert torch.allclose(terms.total, expected)
    assert min(terms.numbers().values()) > 0


def test_consistency_counts_by_the_share_of_pairs_that_a_process_holds(images: torch.Tensor):
    pairs = Pairs(torch.tensor([0]), torch.tensor([1]), torch.zeros(1, 2, 40, 48))
    whole, half = (
        score(images, images.flip(0), LossConfig(temporal=1.0), load_lpips(), replace(pairs, share=share)).temporal
        for share in (1.0, 0.5)
    )
    assert whole > 0
    torch.testing.assert_close(half, whole / 2)


def test_equal_images_cost_nothing(images: torch.Tensor):
    terms = score(images, images, LossConfig(), load_lpips())
    assert float(terms.total) == pytest.approx(0.0, abs=1e-6)


def test_units_that_fire_now_and_then_are_left_alone():
    drive = torch.randn(4, 6, 20, 20, generator=torch.Generator().manual_seed(3))
    assert silence([drive, drive - 0.8]) == 0
    assert silence([drive - 3]) == pytest.approx(2, abs=0.2)


def test_a_silent_unit_is_pulled_back_until_it_fires():
    layer = nn.Conv2d(3, 5, 3)
    nn.init.constant_(layer.bias, -20.0)
    images = torch.rand(2, 3, 12, 12, generator=torch.Generator().manual_seed(0))
    optimiser = torch.optim.SGD(layer.parameters(), lr=0.5)
    for _ in range(400):
        optimiser.zero_grad()
        silence([layer(images)]).backward()
        optimiser.step()
    assert ((layer(images) > 0).float().mean((0, 2, 3)) > 0.1).all()


def test_the_upsamplers_drives_are_seen_and_decoding_stays_as_it_was():
    model = build_model("tiny")
    pyramid, _ = model.encode(torch.randn(1, 5, 40, 48, generator=torch.Generator().manual_seed(0)), None)
    alone, _ = model.decode(pyramid)
    with drives_of(model) as drives:
        watched, _ = model.decode(pyramid)
    assert torch.equal(alone, watched)
    assert [drive.shape[1] for drive in drives] == [16, 8, 4]
    model.decode(pyramid)
    assert len(drives) == 3


def test_tone_is_forgiven_where_it_cannot_be_known():
    generator = torch.Generator().manual_seed(0)
    target = torch.rand(2, 1, 12, 16, generator=generator)
    prediction = (0.4 * target + 0.1).requires_grad_()
    fitted = without_tone(prediction, target, torch.tensor([True, False]))
    torch.testing.assert_close(fitted[0], target[0], atol=1e-3, rtol=0)
    assert torch.equal(fitted[1], prediction[1])
    upside_down = without_tone(1 - target, target, torch.tensor([True, True]))
    assert (upside_down - target).abs().mean() > 0.2
    fitted.sum().backward()
    assert prediction.grad is not None
    assert torch.isfinite(prediction.grad).all()
    flat = without_tone(torch.full_like(target, 0.5), target, torch.tensor([True, True]))
    torch.testing.assert_close(flat.mean((1, 2, 3)), target.mean((1, 2, 3)))
