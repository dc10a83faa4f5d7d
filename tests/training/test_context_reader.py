from dataclasses import replace
from pathlib import Path

import pytest
import torch

from etnet.nets.presets import build_model
from etnet.training.config import LossConfig
from etnet.training.context_reader import CELLS, ContextReader, context_of
from etnet.training.loop import train
from tests.training.micro import micro


def reader_of(dim: int = 32) -> ContextReader:
    return ContextReader(dim, torch.Generator().manual_seed(0))


def test_the_error_is_the_mean_over_cells_of_the_image_alone():
    reader, target = reader_of(), torch.rand(2, 1, 20, 13, generator=torch.Generator().manual_seed(1))
    context = torch.randn(2, 32, 3, 2, generator=torch.Generator().manual_seed(2))
    read = reader(context)
    assert read.shape == (2, 1, 3 * CELLS, 2 * CELLS)
    pixels = read.repeat_interleave(2, -2).repeat_interleave(2, -1)[..., 2:22, 2:15]  # centred: 24 × 16 over 20 × 13
    # columns 15 … is half a cell wide: cells are compared by what of them lies on the sensor
    whole = slice(0, 12)
    by_cell = (pixels - target)[..., whole].unfold(-2, 2, 2).unfold(-2, 2, 2).mean((-1, -2)).abs()
    last = (pixels - target)[..., 12:].unfold(-2, 2, 2).mean(-1).abs().sum() / 2
    expected = (by_cell.sum() + last) / (2 * (10 * 6 + 10 / 2))
    assert reader.error(context, target).item() == pytest.approx(expected.item(), rel=1e-4)


def test_watching_what_tpa_gives_changes_no_frame_and_ends():
    model, voxel = build_model("tiny"), torch.randn(1, 5, 40, 48, generator=torch.Generator().manual_seed(0))
    with context_of(model) as seen:
        watched = model(voxel).frame
    assert seen[0].shape == (1, 32, 5, 6)
    assert torch.equal(model(voxel).frame, watched)
    assert len(seen) == 1


def test_the_error_reaches_tpa_and_not_the_upsampler():
    model, reader = build_model("tiny"), reader_of()
    with context_of(model) as seen:
        model(torch.randn(1, 5, 40, 48, generator=torch.Generator().manual_seed(0)))
    reader.error(seen[0], torch.rand(1, 1, 40, 48)).backward()
    assert all(p.grad is None for p in model.upsampler.parameters())
    assert any(p.grad is not None and p.grad.abs().sum() > 0 for p in model.tpa.parameters())


def test_a_run_with_it_goes_on_as_if_it_had_not_stopped(tmp_path: Path):
    config = micro(tmp_path / "a", loss=LossConfig(num_scored=1, context=1.0))
    whole = train(config)
    half = replace(config, out=tmp_path / "b", stages=(replace(config.stages[0], updates=3),))
    train(half)
    resumed = train(replace(config, out=tmp_path / "b"), changed=True)
    for name, value in whole.reader.state_dict().items():
        assert torch.equal(value, resumed.reader.state_dict()[name]), name
    for name, value in whole.model.state_dict().items():
        assert torch.equal(value, resumed.model.state_dict()[name]), name
