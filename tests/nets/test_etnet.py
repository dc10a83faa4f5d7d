"""ET-Net: sizes, the split into encode and decode, padding, ablations."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from etnet.errors import ModelError
from etnet.nets.attention import AttentionProbe
from etnet.nets.etnet import ETNet, ETNetConfig, squashed
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.padding import TokenGrid, crop_to_sensor, pad_to_grid
from etnet.nets.positions import Placement, grid_positions, raster_positions
from etnet.nets.presets import PRESETS, build_model, num_parameters
from etnet.nets.runtime import Runtime, apply_runtime


def _voxels(count: int, height: int = 21, width: int = 38, bins: int = 5) -> torch.Tensor:
    return torch.randn(count, 1, bins, height, width, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize(
    ("config", "count"),
    [
        ("etnet", 22_175_361),
        ("etnet-half", 5_578_689),
        # The paper compares these pairs "of similar parameter amounts"; per layer: encoder 789,760, decoder 1,053,952.
        (ETNetConfig.ablation(4, 4), 22_175_361 - 3 * 789_760 + (2 * 789_760 + 2 * 1_053_952) + 524_544),
        (ETNetConfig.ablation(4, 3, decoders=False), 22_175_361 + 3 * 789_760 - 6 * 1_053_952),
    ],
)
def test_parameter_counts(config, count: int):
    assert num_parameters(build_model(config)) == count


def test_step_is_decode_after_encode_and_a_state_gives_its_own_frame():
    model, state = build_model("tiny"), None
    with torch.inference_mode():
        for voxel in _voxels(3):
            pyramid, after = model.encode(voxel, state)
            frame, _ = model.decode(pyramid)
            step = model(voxel, state)
            again, _ = model.decode(model.pyramid(voxel, after))
            assert torch.equal(step.frame, frame)
            assert torch.equal(step.frame, again)
            assert all(torch.equal(a, b) for a, b in zip(step.state, after, strict=True))
            state = after


def test_a_step_writes_to_nothing():
    model = build_model("tiny")
    with torch.inference_mode():
        first = model(_voxels(1)[0])
        kept = first.state.clone()
        weights = {name: value.clone() for name, value in model.state_dict().items()}
        model(_voxels(2)[1], first.state)
    assert all(torch.equal(a, b) for a, b in zip(first.state, kept, strict=True))
    assert all(torch.equal(value, weights[name]) for name, value in model.state_dict().items())


@pytest.mark.parametrize("path", ["fused", "plain"])
def test_observing_never_changes_the_frame(path):
    model = build_model("tiny")
    apply_runtime(model, Runtime(attention=path))
    with torch.inference_mode():
        plain, probed = model(_voxels(1)[0]), model(_voxels(1)[0], probe=AttentionProbe())
    assert torch.equal(plain.frame, probed.frame)
    assert all(torch.equal(a, b) for a, b in zip(plain.state, probed.state, strict=True))
    assert plain.attention is None


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 40), st.integers(1, 40))
def test_padding_is_centred_and_undone(height: int, width: int):
    image = torch.arange(height * width, dtype=torch.float32).reshape(1, 1, height, width) + 1
    padded, grid = pad_to_grid(image), TokenGrid(height, width)
    assert padded.shape[-2] % 8 == 0
    assert padded.shape[-1] % 8 == 0
    assert torch.equal(crop_to_sensor(padded, height, width), image)
    bottom, right = padded.shape[-2] - height - grid.top, padded.shape[-1] - width - grid.left
    assert 0 <= grid.top - bottom <= 1
    assert 0 <= grid.left - right <= 1
    for x, y in ((0, 0), (width - 1, height - 1), (width // 2, height // 2)):
        token = grid.token_at(x, y)
        row, column = divmod(token, grid.columns)
        box = padded[0, 0, row * 8 : row * 8 + 8, column * 8 : column * 8 + 8]
        assert image[0, 0, y, x] in box


@pytest.mark.parametrize("scales", [1, 2, 3, 4])
@pytest.mark.parametrize("decoder_depth", [0, 1])
@pytest.mark.parametrize("skips", [True, False])
def test_every_ablation_runs_and_gives_values_in_0_1(scales: int, decoder_depth: int, skips: bool):
    config = ETNetConfig(
        base_channels=2, dim=16, heads=2, feed_forward=16, scales=scales, encoder_depth=1,
        decoder_depth=decoder_depth, skips=skips,
    )  # fmt: skip
    with torch.inference_mode():
        frame = build_model(config)(_voxels(1)[0]).frame
    assert frame.shape == (1, 1, 21, 38)
    assert 0 < frame.min() <= frame.max() < 1


def test_positions_fit_a_sensor_of_14400_tokens():
    assert raster_positions(90, 160, 256).shape == (14_400, 256)
    assert grid_positions(90, 160, 256).shape == (14_400, 256)


def test_raster_positions_are_the_papers_sinusoid():
    table = raster_positions(3, 4, 6).numpy()
    for index in range(12):
        for j in range(6):
            angle = index / 10_000 ** (2 * (j // 2) / 6)
            assert table[index, j] == pytest.approx(np.sin(angle) if j % 2 == 0 else np.cos(angle), abs=1e-6)


def test_a_placed_crop_gets_the_positions_of_the_sensor_it_lies_on():
    whole = raster_positions(10, 12, 8).reshape(10, 12, 8)
    part = raster_positions(3, 4, 8, Placement(row=2, column=5, stride=12)).reshape(3, 4, 8)
    assert torch.equal(part, whole[2:5, 5:9])
    whole = grid_positions(10, 12, 8).reshape(10, 12, 8)
    part = grid_positions(3, 4, 8, Placement(row=2, column=5)).reshape(3, 4, 8)
    assert torch.equal(part, whole[2:5, 5:9])


def test_an_empty_intervention_is_the_original_to_the_bit():
    model, voxel = build_model("tiny"), _voxels(1)[0]
    with torch.inference_mode():
        assert torch.equal(model(voxel).frame, model(voxel, intervention=Intervention()).frame)
    assert Intervention() == ORIGINAL


@pytest.mark.parametrize(
    "intervention",
    [
        Intervention(masked_heads=frozenset({("scale1.encoder.0.self", 1)})),
        Intervention(removed_sites=frozenset({"scale2.decoder.0.cross"})),
        Intervention(uniform_sites=frozenset({"scale3.encoder.0.self"})),
        Intervention(removed_scales=frozenset({1})),
        Intervention(removed_skips=frozenset({0})),
        Intervention(uniform_attention=True),
        Intervention(without_decoders=True),
        Intervention(without_context=True),
    ],
)
def test_each_intervention_changes_the_frame_and_not_the_memory(intervention: Intervention):
    model, voxel = build_model("tiny"), _voxels(1)[0]
    with torch.inference_mode():
        plain, changed = model(voxel), model(voxel, intervention=intervention)
    assert not torch.equal(plain.frame, changed.frame)
    assert all(torch.equal(a, b) for a, b in zip(plain.state, changed.state, strict=True))
    assert not intervention.changes_memory


@pytest.mark.parametrize("kind", ["zeroed_levels", "frozen_levels"])
def test_interventions_on_memory_hold_for_their_level(kind: str):
    model, (first, second) = build_model("tiny"), _voxels(2)
    intervention = Intervention(**{kind: frozenset({2})})
    with torch.inference_mode():
        state = model(first).state
        plain, changed = model(second, state), model(second, state, intervention=intervention)
        cold = model(second)
    assert torch.equal(changed.state.tensors[0], plain.state.tensors[0])
    if kind == "frozen_levels":
        assert torch.equal(changed.state.tensors[2], state.tensors[2])
    else:
        assert not torch.equal(changed.state.tensors[2], plain.state.tensors[2])
        assert not torch.equal(changed.state.tensors[2], cold.state.tensors[2])
    assert intervention.changes_memory


def test_a_batch_equals_its_members_closely():
    model, voxels = build_model("tiny"), _voxels(2)[:, 0]
    with torch.inference_mode():
        together = model(voxels).frame
        alone = torch.cat([model(voxel[None]).frame for voxel in voxels])
    torch.testing.assert_close(together, alone, atol=1e-6, rtol=0)


def test_wrong_bins_and_impossible_configurations_are_refused():
    with pytest.raises(ModelError, match="takes"):
        build_model("tiny")(torch.zeros(1, 4, 16, 16))
    with pytest.raises(ModelError, match="scales"):
        ETNetConfig(scales=5)
    with pytest.raises(ModelError, match="upsampler"):
        ETNet(ETNetConfig(dim=128))
    with pytest.raises(ModelError, match="preset"):
        build_model("nope")


def test_large_counts_are_squashed_where_the_network_says_so():
    counts = torch.tensor([-100.0, -0.01, 0.0, 0.01, 4.0, 100.0]).view(1, 1, 1, 6)
    small = squashed(counts, 4.0)
    torch.testing.assert_close(small[..., 1:4], counts[..., 1:4], atol=1e-4, rtol=0)
    assert small.abs().max() < 4 * math.log(27)
    torch.testing.assert_close(squashed(-counts, 4.0), -small)
    plain, bounded = build_model("tiny"), build_model(replace(PRESETS["tiny"], squash=4.0))
    voxel = torch.full((1, 5, 16, 16), 50.0)
    assert not torch.equal(plain(voxel).frame, bounded(voxel).frame)
    state = bounded(voxel).state
    step = bounded(voxel, state)
    assert torch.equal(bounded.decode(bounded.pyramid(voxel, step.state))[0], step.frame)
