"""PIE-Net: the published package's frames, its equations, its names, and what comes back from step to step."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from etnet.cli.main import main
from etnet.errors import ModelError, WeightsError
from etnet.nets.base import Reconstructor
from etnet.nets.intervention import Intervention
from etnet.nets.pienet import PIENET_PRESETS, PIENet, PIENetConfig
from etnet.nets.presets import build_model, num_parameters
from etnet.nets.released_pienet import is_pienet, pienet_from_released
from etnet.nets.weights import load_model, load_strictly, load_weights, save_weights
from tests.nets import rival_twins

FRAMES = Path(__file__).parent / "pie_net_lite_frames.npz"
"""What `event-pienet` 1.1.3 (MIT) gives for these voxels with its Lite weights rounded to fp16."""

SMALL = PIENetConfig(channels=(4, 8, 12, 16), pools=(2, 2, 5))


def released(config: PIENetConfig, seed: int = 0) -> dict[str, Tensor]:
    """Random weights under the package's names, with a variance that is not zero."""
    generator = torch.Generator().manual_seed(seed)
    widths, shapes = config.channels, {}

    def conv_norm(name: str, channels_in: int, channels_out: int, side: int) -> None:
        shapes[f"{name}.convna.0.weight"] = (channels_out, channels_in, side, side)
        for leaf in ("0.bias", "1.weight", "1.bias"):
            shapes[f"{name}.convna.{leaf}"] = (channels_out,)

    conv_norm("model.stem.event_branch.mbconv", config.bins, widths[0], 3)
    conv_norm("model.stem.frame_branch.mbconv", 1, widths[0], 3)
    for i in range(len(config.pools)):
        name, both = f"model.downs.{i}", widths[i] + widths[i + 1]
        conv_norm(f"{name}.mbd.Gates.mbconv.0", both, 2 * both, 3)
        shapes[f"{name}.mbd.Gates.mbconv.1.fc1.weight"] = (2 * both // 8, 2 * both, 1, 1)
        shapes[f"{name}.mbd.Gates.mbconv.1.fc2.weight"] = (2 * both, 2 * both // 8, 1, 1)
        conv_norm(f"{name}.mbd.Gates.mbconv.2", 2 * both, 4 * widths[i + 1], 1)
        for norm in ("norm_h", "norm_c"):
            shapes |= {f"{name}.mbd.{norm}.{leaf}": (widths[i + 1],) for leaf in ("weight", "bias")}
        if config.refines:
            conv_norm(f"{name}.out.mbconv_0.mbconv", widths[i + 1], widths[i + 1], 3)
        shapes[f"{name}.film.film.weight"] = (2 * widths[i + 1], 2 * widths[0], 1, 1)
        shapes[f"{name}.film.film.bias"] = (2 * widths[i + 1],)
    for i in range(len(config.pools)):
        level = len(config.pools) - 1 - i
        conv_norm(f"model.ups.{i}.fuse.0.mbconv", 2 * widths[level + 1], widths[level], 3)
        shapes[f"model.ups.{i}.ugate.gate_conv.weight"] = (widths[level + 1], 1, 1, 1)
        shapes[f"model.ups.{i}.ugate.gate_conv.bias"] = (widths[level + 1],)
    shapes |= {"model.outc.weight": (3, widths[0], 1, 1), "model.outc.bias": (3,)}
    conv_norm("cal_k.mbconv", 3, 1, 3)
    weights = {
        name: torch.randn(shape, generator=generator) * (0.5 if len(shape) == 1 else math.prod(shape[1:]) ** -0.5)
        for name, shape in shapes.items()
    }
    weights["model.outc.bias"] = torch.full((3,), 0.7)
    return weights


def model_of(config: PIENetConfig, weights: dict[str, Tensor]) -> PIENet:
    read, state = pienet_from_released(weights)
    assert read == config
    model = PIENet(config).eval()
    load_strictly(model, state, "random")
    return model


def voxels(count: int, size: tuple[int, int]) -> list[Tensor]:
    generator = torch.Generator().manual_seed(7)
    return [torch.randn(1, 5, *size, generator=generator) for _ in range(count)]


@pytest.mark.parametrize("size", [(40, 60), (45, 61), (20, 23)])
@pytest.mark.parametrize("config", [SMALL, replace(SMALL, refines=False), PIENET_PRESETS["pie-net-lite"]])
def test_frames_and_variances_are_the_equations(config: PIENetConfig, size: tuple[int, int]):
    weights = released(config)
    model, inputs, state = model_of(config, weights), voxels(3, size), None
    plain = {name: tensor.double().numpy() for name, tensor in weights.items()}
    expected = rival_twins.pie_net([voxel[0].double().numpy() for voxel in inputs], plain, config.pools)
    with torch.inference_mode():
        for voxel, (frame, variance) in zip(inputs, expected, strict=True):
            step = model(voxel, state)
            state = step.state
            np.testing.assert_allclose(step.frame[0].numpy(), frame, atol=2e-5)
            assert step.variance is not None
            np.testing.assert_allclose(step.variance[0].numpy(), variance, rtol=1e-3, atol=1e-4)
    assert max(variance.max() for _, variance in expected) > 0.01


def test_the_bundled_lite_gives_the_packages_frames():
    model, recorded, state = load_model("pie-net-lite"), np.load(FRAMES), None
    with torch.inference_mode():
        for voxel, frame in zip(recorded["voxels"], recorded["frames"], strict=True):
            step = model(torch.from_numpy(voxel).float()[None], state)
            state = step.state
            np.testing.assert_allclose(step.frame[0, 0].numpy(), frame, atol=1e-5)


def test_both_have_the_published_number_of_parameters():
    assert num_parameters(build_model("pie-net-lite")) == 78_537
    assert num_parameters(build_model(replace(PIENetConfig(), refines=False))) == 154_201
    assert num_parameters(build_model("pie-net")) == 171_121


def test_a_kept_state_gives_its_own_frame_and_variance():
    model = model_of(SMALL, released(SMALL))
    assert isinstance(model, Reconstructor)
    with torch.inference_mode():
        first, second = voxels(2, (40, 60))
        state = model(first).state
        step = model(second, state)
        again, attention = model.decode(model.pyramid(second, step.state))
    assert attention is None
    assert torch.equal(again, step.frame)
    assert step.variance is not None
    assert torch.equal(model.variance(step.state), step.variance)


def test_levels_can_be_zeroed_and_frozen():
    model = model_of(SMALL, released(SMALL))
    first, second = voxels(2, (40, 60))
    with torch.inference_mode():
        before = model(first).state
        frozen = model(second, before, intervention=Intervention(frozen_levels=frozenset({2}))).state
        zeroed = model(second, before, intervention=Intervention(zeroed_levels=frozenset({1}))).state
        plain = model(second, before).state
    assert torch.equal(frozen.tensors[2], before.tensors[2])
    assert not torch.equal(plain.tensors[2], before.tensors[2])
    assert not torch.equal(zeroed.tensors[0], plain.tensors[0])


@pytest.mark.parametrize("preset", ["tiny", "firenet", "pie-net-lite"])
def test_of_zeroed_and_frozen_zeroed_wins_in_every_network(preset: str):
    model, level = build_model(preset), frozenset({1})
    first, second = voxels(2, (40, 60))
    with torch.inference_mode():
        before = model(first).state
        zeroed, both = (
            model(second, before, intervention=Intervention(zeroed_levels=level, frozen_levels=frozen)).state
            for frozen in (frozenset(), level)
        )
    assert all(map(torch.equal, both, zeroed))


@pytest.mark.parametrize("name", PIENET_PRESETS)
def test_convert_reads_both_files_of_the_package(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    weights = released(PIENET_PRESETS[name])
    assert is_pienet(weights)
    torch.save(weights, tmp_path / "model.pth")
    assert main(["convert", str(tmp_path / "model.pth"), str(tmp_path / "ours.safetensors")]) == 0
    assert f"{'PIE-Net-Lite' if name.endswith('lite') else 'PIE-Net'}, " in capsys.readouterr().err
    voxel = voxels(1, (40, 60))[0]
    with torch.inference_mode():
        converted = load_weights(tmp_path / "ours.safetensors")(voxel)
        assert torch.equal(converted.frame, model_of(PIENET_PRESETS[name], weights)(voxel).frame)


def test_its_weights_file_keeps_the_configuration(tmp_path: Path):
    model = model_of(SMALL, released(SMALL))
    save_weights(model, tmp_path / "small.safetensors")
    assert load_weights(tmp_path / "small.safetensors").config == SMALL


def test_what_does_not_fit_is_said():
    with pytest.raises(ModelError, match="takes at least 20 × 20"):
        build_model("pie-net")(torch.zeros(1, 5, 19, 40))
    with pytest.raises(ModelError, match="one more than the 2 pools"):
        PIENetConfig(channels=(8, 16), pools=(2, 2))
    with pytest.raises(ModelError, match="multiples of 4"):
        PIENetConfig(channels=(8, 18), pools=(2,))
    with pytest.raises(WeightsError, match="in no published PIE-Net"):
        pienet_from_released({"model.other.weight": torch.ones(1)})
