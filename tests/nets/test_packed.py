"""Packed layers: equal to plain torch to rounding, exact among themselves, out of the way where they do not apply."""

import copy
import itertools
from typing import get_args

import pytest
import torch

from etnet.nets import packed
from etnet.nets.attention import AttentionProbe, MultiHeadAttention, Observer
from etnet.nets.attention_kernels import KERNELS
from etnet.nets.base import Step
from etnet.nets.intervention import ORIGINAL
from etnet.nets.packed import pack, unpack
from etnet.nets.presets import build_model
from etnet.nets.runtime import AttentionPath, Contract, Runtime, apply_runtime, contract_of, default_runtime

PACKED = Runtime(attention="by_heads", channels_last=True, packed=True)
EVERY_PATH = [
    Runtime(),
    PACKED,
    Runtime("bf16"),
    Runtime("bf16", "tiled", channels_last=True, packed=True),
    Runtime("bf16", "by_heads", packed=True),
]
SMALL = ("tiny", "firenet", "e2vid-res6")


def _voxels(count: int = 3, height: int = 37, width: int = 50) -> torch.Tensor:
    return torch.randn(count, 1, 5, height, width, generator=torch.Generator().manual_seed(1))


def _steps(model, voxels: torch.Tensor, probe: AttentionProbe | None = None) -> list[Step]:
    steps, state = [], None
    with torch.inference_mode():
        for voxel in voxels:
            steps.append(model(voxel, state, probe))
            state = steps[-1].state
    return steps


def _model(preset: str, runtime: Runtime):
    model = build_model(preset)
    for parameter in model.parameters():
        parameter.requires_grad_(False)
    apply_runtime(model, runtime)
    return model


@pytest.mark.parametrize("preset", SMALL)
def test_packed_and_plain_are_equal_to_rounding(preset: str):
    plain, fast = (_steps(_model(preset, runtime), _voxels()) for runtime in (Runtime(), PACKED))
    for one, other in zip(plain, fast, strict=True):
        scale = float(one.frame.abs().max())
        torch.testing.assert_close(other.frame, one.frame, atol=5e-6 * max(scale, 1), rtol=0)
        for a, b in zip(one.state, other.state, strict=True):
            torch.testing.assert_close(b, a, atol=5e-6, rtol=1e-5)


def test_packed_and_plain_bf16_are_equally_far_from_fp32():
    exact, plain, fast = (_steps(_model("tiny", runtime), _voxels()) for runtime in (EVERY_PATH[0], *EVERY_PATH[2:4]))
    errors = [
        max(float((a.frame - b.frame).abs().max()) for a, b in zip(exact, run, strict=True)) for run in (plain, fast)
    ]
    assert 0 < errors[1] < 2 * errors[0] < 0.05
    assert all(tensor.dtype == torch.float32 for tensor in fast[-1].state)


@pytest.mark.parametrize("path", get_args(AttentionPath))
@pytest.mark.parametrize("num_tokens", [1, 191, 192, 193, 500])
def test_every_attention_kernel_computes_the_same_sums(path: AttentionPath, num_tokens: int):
    generator = torch.Generator().manual_seed(num_tokens)
    query, key, value = (3 * torch.randn(3, 1, 2, num_tokens, 8, generator=generator)).unbind()
    with torch.inference_mode():
        mixed = KERNELS[path](query, key, value, 0.3)
        wanted = torch.softmax(query.double() @ key.double().transpose(-1, -2) * 0.3, dim=-1) @ value.double()
    torch.testing.assert_close(mixed.double(), wanted, atol=1e-4, rtol=0)


@pytest.mark.parametrize("runtime", EVERY_PATH, ids=str)
def test_observing_never_changes_the_frame_in_any_path(runtime: Runtime):
    model = _model("tiny", runtime)
    for plain, probed in zip(_steps(model, _voxels()), _steps(model, _voxels(), AttentionProbe()), strict=True):
        assert torch.equal(plain.frame, probed.frame)
        assert all(torch.equal(a, b) for a, b in zip(plain.state, probed.state, strict=True))


@pytest.mark.parametrize("runtime", EVERY_PATH, ids=str)
def test_a_path_gives_the_same_bits_again_whatever_ran_between(runtime: Runtime):
    model, other_size = _model("tiny", runtime), _voxels(1, 21, 90)
    first = _steps(model, _voxels())
    _steps(model, other_size)
    for again in (_steps(model, _voxels()), _steps(copy.deepcopy(model), _voxels())):
        assert all(torch.equal(a.frame, b.frame) for a, b in zip(first, again, strict=True))
    voxel, after = _voxels()[-1], first[-1].state
    with torch.inference_mode():
        assert torch.equal(model.decode(model.pyramid(voxel, after))[0], first[-1].frame)


def test_unpacked_is_what_it_was_to_the_bit():
    model = _model("tiny", Runtime())
    before = _steps(model, _voxels())
    apply_runtime(model, PACKED)
    _steps(model, _voxels())
    apply_runtime(model, Runtime())
    assert not any("forward" in module.__dict__ or "_project" in module.__dict__ for module in model.modules())
    assert all(torch.equal(a.frame, b.frame) for a, b in zip(before, _steps(model, _voxels()), strict=True))


def test_without_onednn_the_layers_own_forward_runs(monkeypatch):
    plain = _steps(_model("tiny", Runtime(channels_last=True)), _voxels())
    monkeypatch.setattr(packed, "has_onednn", lambda: False)
    fallback = _steps(_model("tiny", Runtime(channels_last=True, packed=True)), _voxels())
    assert all(torch.equal(a.frame, b.frame) for a, b in zip(plain, fallback, strict=True))


def test_gradients_are_those_of_plain_torch():
    gradients = []
    for runtime in (Runtime(), Runtime(packed=True)):
        model = _model("tiny", runtime)
        voxel = _voxels(1)[0].requires_grad_()
        model(voxel).frame.sum().backward()
        gradients.append(voxel.grad)
    assert torch.equal(gradients[0], gradients[1])


def test_a_gradient_that_comes_from_the_state_alone_is_that_of_plain_torch():
    gradients = []
    for runtime in (Runtime(), Runtime(packed=True)):
        model = _model("tiny", runtime)
        first, second = _voxels(2)
        first.requires_grad_()
        model(second, model(first).state).frame[0, 0, 20, 20].backward()
        assert first.grad is not None
        gradients.append(first.grad)
    assert gradients[0].abs().max() > 0
    torch.testing.assert_close(gradients[1], gradients[0], atol=1e-5 * float(gradients[0].abs().max()), rtol=1e-3)


def test_a_gradient_that_comes_from_the_memory_of_attention_is_that_of_plain_torch():
    query, memory = _voxels(2, 7, 16)[:, 0, 0].unsqueeze(1).unbind()
    attention = MultiHeadAttention(16, 2, "site").requires_grad_(False)
    gradients = []
    for prepare in (unpack, pack):
        prepare(attention)
        given = memory.clone().requires_grad_()
        attention(query, given, Observer(None, ORIGINAL)).square().sum().backward()
        assert given.grad is not None
        gradients.append(given.grad)
    torch.testing.assert_close(gradients[1], gradients[0], atol=1e-5, rtol=1e-4)


def test_weights_that_change_are_packed_again():
    model, other = _model("tiny", PACKED), build_model("tiny", torch.Generator().manual_seed(7))
    before = _steps(model, _voxels())
    model.load_state_dict(other.state_dict())
    apply_runtime(other, PACKED)
    after, wanted = _steps(model, _voxels()), _steps(other, _voxels())
    assert not torch.equal(before[0].frame, after[0].frame)
    assert all(torch.equal(a.frame, b.frame) for a, b in zip(after, wanted, strict=True))


def test_the_packed_path_is_part_of_the_contract_and_so_is_the_processor():
    model = _model("tiny", default_runtime())
    contracts = [contract_of(model)]
    for runtime in EVERY_PATH:
        apply_runtime(model, runtime)
        contracts.append(contract_of(model))
    assert all(a != b for a, b in itertools.combinations(contracts[1:], 2))
    assert isinstance(contracts[0], Contract)
    assert contracts[0].isa
