"""E2VID and FireNet: sizes, their equations, released names, one step split in two."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from etnet.errors import ModelError, WeightsError
from etnet.nets.base import Reconstructor
from etnet.nets.convert import convert_checkpoint
from etnet.nets.e2vid import E2VID, E2VID_PLUS, E2VID_PRESETS, E2VIDConfig
from etnet.nets.firenet import FIRENET_PRESETS, FireNet, FireNetConfig
from etnet.nets.intervention import Intervention
from etnet.nets.presets import num_parameters
from etnet.nets.released_rivals import (
    e2vid_config_of,
    e2vid_state_from_released,
    firenet_config_of,
    firenet_state_from_released,
    fold_batch_norms,
    is_legacy_firenet,
)
from etnet.nets.weights import load_weights, save_weights
from tests.nets import rival_twins

SMALL = E2VIDConfig(base_channels=4)


def random_state(shapes: dict[str, tuple[int, ...]], seed: int = 0) -> dict[str, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    spread = {name: 0.1 if len(shape) == 1 else math.prod(shape[1:]) ** -0.5 for name, shape in shapes.items()}
    return {name: spread[name] * torch.randn(shape, generator=generator) for name, shape in shapes.items()}


def convolution(name: str, channels_in: int, channels_out: int, side: int) -> dict[str, tuple[int, ...]]:
    return {f"{name}.weight": (channels_out, channels_in, side, side), f"{name}.bias": (channels_out,)}


def released_firenet(is_legacy: bool, channels: int = 16) -> dict[str, Tensor]:
    """Random weights under the released names, in both spellings."""
    head, gates = ("net.head.conv", ["net.head", "net.resblocks.0"]) if is_legacy else ("head", ["G1", "G2"])
    residuals = ["net.resblocks.0.conv", "net.resblocks.1"] if is_legacy else ["R1", "R2"]
    shapes = convolution(f"{head}.conv2d", 5, channels, 3)
    for name in gates:
        block = f"{name}.recurrent_block" if is_legacy else name
        for gate in ("reset_gate", "update_gate", "out_gate"):
            shapes |= convolution(f"{block}.{gate}", 2 * channels, channels, 3)
    for name in residuals:
        for part in ("conv1", "conv2"):
            shapes |= convolution(f"{name}.{part}", channels, channels, 3)
    return random_state(shapes | convolution("net.pred.conv2d" if is_legacy else "pred.conv2d", channels, 1, 1))


def released_e2vid(wrapper: str, base: int = 4, residuals: int = 2, outputs: int = 1) -> dict[str, Tensor]:
    shapes = convolution("head.conv2d", 5, base, 5)
    for i in range(3):
        shapes |= convolution(f"encoders.{i}.conv.conv2d", base * 2**i, base * 2 ** (i + 1), 5)
        shapes |= convolution(f"encoders.{i}.recurrent_block.Gates", base * 2 ** (i + 2), base * 2 ** (i + 3), 3)
        shapes |= convolution(f"decoders.{i}.conv2d", base * 2 ** (3 - i), base * 2 ** (2 - i), 5)
    for i in range(residuals):
        shapes |= convolution(f"resblocks.{i}.conv1", 8 * base, 8 * base, 3)
        shapes |= convolution(f"resblocks.{i}.conv2", 8 * base, 8 * base, 3)
    shapes |= convolution("pred.conv2d", base, outputs, 1)
    return {f"{wrapper}.{name}": tensor for name, tensor in random_state(shapes).items()}


def voxels(count: int, height: int = 24, width: int = 32) -> list[Tensor]:
    generator = torch.Generator().manual_seed(7)
    return [torch.randn(1, 5, height, width, generator=generator) for _ in range(count)]


def frames_of(model: Reconstructor, inputs: list[Tensor]) -> list[Tensor]:
    state, frames = None, []
    with torch.inference_mode():
        for voxel in inputs:
            step = model(voxel, state)
            state = step.state
            frames.append(step.frame)
    return frames


@pytest.mark.parametrize(
    ("model", "count"),
    [
        ("firenet", 37_777),
        ("firenet+", 37_777),
        ("e2vid", 10_710_401),
        ("e2vid+", 10_710_467),
        ("e2vid-res6", 15_431_041),
        ("e2vid-res12", 22_512_001),
        ("e2vid-res16", 27_232_641),
    ],
)
def test_parameter_counts_are_the_published_ones(model: str, count: int) -> None:
    with torch.device("meta"):
        built = E2VID(E2VID_PRESETS[model]) if model in E2VID_PRESETS else FireNet(FIRENET_PRESETS[model])
    assert num_parameters(built) == count


@pytest.mark.parametrize("is_legacy", [True, False])
def test_a_converted_firenet_gives_the_published_frames(is_legacy: bool) -> None:
    released = released_firenet(is_legacy)
    assert is_legacy_firenet(released) == is_legacy
    state = firenet_state_from_released(released)
    model = FireNet(firenet_config_of(state, normalise_voxels=is_legacy))
    model.load_state_dict(state, strict=True)

    # Both spellings draw the same numbers in the same order, so that one twin serves both.
    plain = {name: tensor.double().numpy() for name, tensor in released_firenet(is_legacy=False).items()}
    inputs = voxels(4, 19, 26)
    expected = rival_twins.firenet([voxel[0].double().numpy() for voxel in inputs], plain)
    for frame, twin in zip(frames_of(model, inputs), expected, strict=True):
        np.testing.assert_allclose(frame[0].numpy(), twin, atol=1e-5)


@pytest.mark.parametrize(("wrapper", "outputs"), [("unetrecurrent", 1), ("unetflow", 3)])
def test_a_converted_e2vid_gives_the_published_frames(wrapper: str, outputs: int) -> None:
    released = released_e2vid(wrapper, outputs=outputs)
    state = e2vid_state_from_released(released)
    config = e2vid_config_of(state)
    assert (config.final, config.normalise_voxels) == (("sigmoid", True) if outputs == 1 else ("none", False))
    model = E2VID(config)
    model.load_state_dict(state, strict=True)

    plain = {name.removeprefix(f"{wrapper}."): tensor.double().numpy() for name, tensor in released.items()}
    inputs = voxels(3)
    expected = rival_twins.e2vid([voxel[0].double().numpy() for voxel in inputs], plain, 2, skips=True)
    for frame, twin in zip(frames_of(model, inputs), expected, strict=True):
        wanted = rival_twins.sigmoid(twin) if outputs == 1 else twin[:1]
        np.testing.assert_allclose(frame[0].numpy(), wanted, atol=1e-5)


def test_without_skips_the_decoder_sees_the_coarsest_level_alone() -> None:
    released = released_e2vid("unetrecurrent", residuals=1)
    model = E2VID(E2VIDConfig(base_channels=4, residual_blocks=1, skips=False, final="none"))
    model.load_state_dict(e2vid_state_from_released(released), strict=True)
    plain = {name.removeprefix("unetrecurrent."): tensor.double().numpy() for name, tensor in released.items()}
    inputs = voxels(2)
    expected = rival_twins.e2vid([voxel[0].double().numpy() for voxel in inputs], plain, 1, skips=False)
    for frame, twin in zip(frames_of(model, inputs), expected, strict=True):
        np.testing.assert_allclose(frame[0].numpy(), twin, atol=1e-5)


class Normed(nn.Module):
    """A residual block with batch norms, under the released names."""

    def __init__(self) -> None:
        super().__init__()
        self.conv1, self.conv2 = (nn.Conv2d(6, 6, 3, padding=1, bias=False) for _ in range(2))
        self.bn1, self.bn2 = nn.BatchNorm2d(6), nn.BatchNorm2d(6)

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(self.bn2(self.conv2(torch.relu(self.bn1(self.conv1(x))))) + x)


def test_batch_norms_vanish_into_their_convolutions() -> None:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(3)
        block = Normed()
        block(torch.randn(8, 6, 9, 9) * 2 + 1)
    block.eval()
    folded = fold_batch_norms({f"resblocks.0.{name}": tensor for name, tensor in block.state_dict().items()})
    assert set(folded) == {f"resblocks.0.conv{i}.{part}" for i in (1, 2) for part in ("weight", "bias")}
    image = torch.randn(1, 6, 9, 9, generator=torch.Generator().manual_seed(4))
    plain = {name: tensor.detach().double().numpy() for name, tensor in folded.items()}
    expected = rival_twins.residual(image[0].double().numpy(), plain, "resblocks.0")
    with torch.inference_mode():
        np.testing.assert_allclose(block(image)[0].numpy(), expected, atol=1e-5)


def test_an_instance_norm_is_refused_by_name() -> None:
    statistics = {"running_mean": torch.zeros(8), "running_var": torch.ones(8), "num_batches_tracked": torch.tensor(9)}
    released = released_e2vid("unetrecurrent")
    released |= {f"unetrecurrent.encoders.0.conv.norm_layer.{name}": value for name, value in statistics.items()}
    with pytest.raises(WeightsError, match=r"encoders\.0\.conv\.norm_layer\.running_mean .* instance norms cannot"):
        e2vid_state_from_released(released)


@pytest.mark.parametrize(
    ("name", "released", "preset"),
    [
        ("firenet.pth", released_firenet(is_legacy=True), FIRENET_PRESETS["firenet"]),
        ("firenet_plus.pth", released_firenet(is_legacy=False), FIRENET_PRESETS["firenet+"]),
        ("e2vid.pth", released_e2vid("unetrecurrent"), SMALL),
        ("e2vid_plus.pth", released_e2vid("unetflow", outputs=3), replace(E2VID_PLUS, base_channels=4)),
    ],
)
def test_a_checkpoint_is_converted_saved_and_loaded(tmp_path: Path, name: str, released, preset) -> None:
    torch.save({"arch": "theirs", "state_dict": released}, tmp_path / name)
    converted, _ = convert_checkpoint(tmp_path / name)
    assert converted.config == preset
    save_weights(converted, tmp_path / "ours.safetensors", dtype=torch.float32)
    loaded = load_weights(tmp_path / "ours.safetensors")
    assert loaded.config == preset
    inputs = voxels(2)
    assert all(map(torch.equal, frames_of(loaded, inputs), frames_of(converted, inputs)))


def test_a_foreign_parameter_is_named() -> None:
    with pytest.raises(WeightsError, match=r"pred\.other"):
        e2vid_state_from_released(released_e2vid("unetrecurrent") | {"pred.other": torch.zeros(1)})


@pytest.mark.parametrize(
    "model", [E2VID(SMALL), E2VID(E2VIDConfig(base_channels=4, outputs=3)), FireNet(FireNetConfig())]
)
def test_a_step_is_decode_after_encode_and_a_state_gives_its_own_frame(model: Reconstructor) -> None:
    assert isinstance(model, Reconstructor)
    state = None
    with torch.inference_mode():
        for voxel in voxels(3, 21, 38):
            step = model(voxel, state)
            pyramid, state = model.encode(voxel, state)
            assert torch.equal(model.decode(pyramid)[0], step.frame)
            assert torch.equal(model.decode(model.pyramid(voxel, state))[0], step.frame)
            assert all(map(torch.equal, state, step.state))
            assert step.frame.shape == (1, 1, 21, 38)
            assert step.attention is None


@pytest.mark.parametrize("model", [E2VID(SMALL), FireNet(FireNetConfig())])
def test_interventions_act_on_the_memory(model: Reconstructor) -> None:
    first, second = voxels(2)
    num_levels = 3 if isinstance(model, E2VID) else 2
    every = frozenset(range(1, num_levels + 1))
    with torch.inference_mode():
        state = model(first).state
        cold = model(second, state, intervention=Intervention(zeroed_levels=every))
        assert torch.equal(cold.frame, model(second).frame)
        frozen = model(second, state, intervention=Intervention(frozen_levels=every))
        assert all(map(torch.equal, frozen.state, state))


def test_the_released_flags_are_the_published_ones() -> None:
    assert E2VIDConfig().normalise_voxels
    assert E2VIDConfig().post_processing == "robust"
    assert not E2VID_PLUS.normalise_voxels
    assert FIRENET_PRESETS["firenet"].normalise_voxels
    assert not FIRENET_PRESETS["firenet+"].normalise_voxels


def test_wrong_grids_and_configurations_are_refused() -> None:
    with pytest.raises(ModelError, match="5"):
        FireNet(FireNetConfig())(torch.zeros(1, 4, 16, 16))
    with pytest.raises(ModelError, match="residual"):
        E2VIDConfig(residual_blocks=-1)
    with pytest.raises(ModelError, match="outputs"):
        E2VIDConfig(outputs=2)
    with pytest.raises(ModelError, match="channels"):
        FireNetConfig(channels=0)
