from dataclasses import replace
from pathlib import Path

import pytest
import torch

from etnet.nets.base import Pyramid
from etnet.nets.padding import TokenGrid
from etnet.nets.presets import build_model
from etnet.training.config import ContextConfig, LossConfig, Stage
from etnet.training.data import stretches
from etnet.training.distributed import World
from etnet.training.run import begin
from etnet.training.unroll import blindfold, draw_placement, draw_update, restart, skip_drop_at, unroll
from tests.training.micro import micro

SMALL = (40, 48)


@pytest.fixture
def voxels() -> torch.Tensor:
    return torch.randn(4, 2, 5, *SMALL, generator=torch.Generator().manual_seed(0))


def test_a_batched_decode_gives_the_frames_of_single_steps(voxels: torch.Tensor):
    model = build_model("tiny")
    with torch.no_grad():
        pyramid, last = unroll(model, voxels, None, (1, 3))
        frames, _ = model.decode(pyramid)
        state, expected = None, []
        for voxel in voxels:
            step = model(voxel, state)
            state = step.state
            expected.append(step.frame)
    torch.testing.assert_close(frames, torch.cat((expected[1], expected[3])), atol=1e-6, rtol=1e-5)
    for got, wanted in zip(last.tensors, state.tensors, strict=True):
        assert torch.equal(got, wanted)


def test_a_clip_that_begins_forgets_and_its_neighbour_does_not(voxels: torch.Tensor):
    model = build_model("tiny")
    with torch.no_grad():
        _, state = unroll(model, voxels[:2], None, (0,))
        _, mixed = unroll(model, voxels[2:], restart(state, torch.tensor([True, False])), (0,))
        _, cold = unroll(model, voxels[2:, :1], None, (0,))
        _, warm = unroll(model, voxels[2:], state, (0,))
    for a, b, c in zip(mixed.tensors, cold.tensors, warm.tensors, strict=True):
        torch.testing.assert_close(a[:1], b, atol=1e-6, rtol=1e-5)
        torch.testing.assert_close(a[1:], c[1:], atol=1e-6, rtol=1e-5)


def test_no_gradient_runs_into_the_stretch_before(voxels: torch.Tensor):
    model = build_model("tiny")
    _, state = unroll(model, voxels[:2], None, (0,))
    carried = restart(state, torch.tensor([False, False]))
    assert carried is not None
    assert not any(tensor.requires_grad for tensor in carried.tensors)


def test_blind_tokens_are_zero_on_every_recurrent_level_and_nowhere_else():
    levels = tuple(torch.ones(1, 2, 40 // 2**level, 48 // 2**level) for level in range(4))
    blind = torch.zeros(1, 5, 6, dtype=torch.bool)
    blind[0, 1, 2] = True
    hidden = blindfold(Pyramid(levels, *SMALL), blind)
    assert torch.equal(hidden.levels[0], levels[0])
    for level in (1, 2, 3):
        patch = 8 // 2**level
        assert not hidden.levels[level][..., patch : 2 * patch, 2 * patch : 3 * patch].any()
        assert (hidden.levels[level] == 0).sum() == 2 * patch**2


def test_a_draw_depends_on_seed_and_update_and_a_lane_on_itself(tmp_path: Path):
    config = micro(tmp_path, context=ContextConfig(blind_share=1.0), stages=(Stage(30, size=SMALL, clips=4),))
    for update in range(10):
        both = draw_update(config, update, range(4))
        own = draw_update(config, update, range(2, 4))
        assert (both.scored, both.intervention, both.placement) == (own.scored, own.intervention, own.placement)
        assert both.blind is not None
        assert own.blind is not None
        assert torch.equal(both.blind.view(-1, 4, 5, 6)[:, 2:], own.blind.view(-1, 2, 5, 6))
    draws = {(draw.scored, draw.placement) for draw in (draw_update(config, update, range(4)) for update in range(10))}
    assert len(draws) == 10


def test_pairs_of_frames_are_scored_where_consistency_counts(tmp_path: Path):
    config = micro(tmp_path, truncate=4, loss=LossConfig(num_scored=4, temporal=1.0, temporal_after=3))
    config = replace(config, truncate=4, data=replace(config.data, windows=4), loss=replace(config.loss, num_scored=2))
    for update in range(3, 6):
        first, second = draw_update(config, update, range(2)).scored
        assert second == first + 1


def test_placements_reach_the_far_end_of_a_large_sensor():
    import numpy as np

    rng, grid = np.random.default_rng(0), TokenGrid(112, 112)
    placed = [draw_placement(ContextConfig(), grid, rng) for _ in range(4000)]
    assert max(place.row + 14 for place in placed) > 80
    assert max(place.column + 14 for place in placed) > 145
    assert min(place.row for place in placed) == 0
    assert all(place.stride is not None and place.column + 14 <= place.stride for place in placed)


def test_dropped_skips_become_rare_in_a_straight_line():
    config = ContextConfig(skip_drop=0.4, skip_drop_end=0.1, skip_drop_updates=100)
    assert [skip_drop_at(config, update) for update in (0, 50, 100, 500)] == pytest.approx([0.4, 0.25, 0.1, 0.1])


def test_the_control_trains_everything_but_tpa(tmp_path: Path):
    control = ContextConfig(without_context=True, skip_drop=0.0, skip_drop_end=0.0)
    run = begin(micro(tmp_path, context=control), World())
    before = {name: value.clone() for name, value in run.model.state_dict().items()}
    for stretch in stretches(run.config, 0, [range(2)]):
        run.step(stretch)
        break
    moved = {name for name, value in run.model.state_dict().items() if not torch.equal(value, before[name])}
    assert moved
    assert not any(name.startswith("tpa.") for name in moved)
    assert all(any(name.startswith(part) for name in moved) for part in ("head.", "backbone.", "upsampler.", "tail."))
