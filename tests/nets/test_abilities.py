"""A network declares what it can do, and what it declares is true."""

from dataclasses import fields, replace

import pytest
import torch

from etnet.nets.abilities import Abilities, abilities_of, lacking
from etnet.nets.adapter import Adapter
from etnet.nets.attention import AttentionProbe
from etnet.nets.base import Reconstructor
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.presets import UNTRAINED, build_model
from etnet.nets.weights import load_model

NETWORKS = ["tiny", "firenet", "e2vid", "pie-net-lite", "leaky-integrator", "adapter"]
CHANGES = {
    "masked_heads": frozenset({("scale1.encoder.0.self", 0)}),
    "removed_sites": frozenset({"scale1.encoder.0.self"}),
    "uniform_sites": frozenset({"scale1.encoder.0.self"}),
    "removed_scales": frozenset({1}),
    "removed_skips": frozenset({0}),
    "zeroed_levels": frozenset({1}),
    "frozen_levels": frozenset({1}),
    "uniform_attention": True,
    "without_decoders": True,
    "without_context": True,
}


def network(name: str) -> Reconstructor:
    if name == "adapter":
        return Adapter(lambda voxel, memory: (voxel.mean(1, keepdim=True), ()), "mean of bins")
    if name == "pie-net-lite":  # with random weights its ReLUs are silent
        return load_model(name)
    return build_model(UNTRAINED.get(name, name))


def voxel(seed: int) -> torch.Tensor:
    return torch.randn(1, 5, 32, 40, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("name", NETWORKS)
def test_a_probe_is_answered_where_attention_is_declared(name: str):
    model = network(name)
    attention = model(voxel(0), probe=AttentionProbe()).attention
    assert (attention is not None) == abilities_of(model).attention


@pytest.mark.parametrize("name", NETWORKS)
def test_a_variance_comes_where_it_is_declared(name: str):
    model = network(name)
    assert (model(voxel(0)).variance is not None) == abilities_of(model).variance


@pytest.mark.parametrize("name", ["tiny", "firenet", "e2vid", "pie-net-lite", "leaky-integrator"])
def test_a_gradient_reaches_the_voxel_grid_where_it_is_declared(name: str):
    model, grid = network(name), voxel(0).requires_grad_()
    assert abilities_of(model).gradients
    model(grid).frame.sum().backward()
    assert grid.grad is not None
    assert grid.grad.abs().sum() > 0


@pytest.mark.parametrize("change", [field.name for field in fields(Intervention)])
@pytest.mark.parametrize("name", ["tiny", "firenet", "e2vid", "pie-net-lite"])
def test_the_interventions_that_are_declared_change_something(name: str, change: str):
    model = network(name)
    with torch.inference_mode():
        before = model(voxel(0)).state
        plain = model(voxel(1), before)
        changed = model(voxel(1), before, intervention=replace(ORIGINAL, **{change: CHANGES[change]}))
    is_changed = not all(torch.equal(a, b) for a, b in zip(plain.state, changed.state, strict=True))
    is_changed |= not torch.equal(plain.frame, changed.frame)
    assert is_changed == (change in abilities_of(model).interventions)


def test_what_cannot_be_shown_is_one_sentence_that_names_the_network():
    assert lacking(network("tiny"), "attention") is None
    assert lacking(network("firenet"), "attention") == (
        "firenet has no attention, so there are no attention maps to show."
    )
    for ability in ("attention", "levels", "gates", "gradients", "split", "variance"):
        sentence = lacking(network("adapter"), ability)
        assert sentence is not None
        assert sentence.startswith("mean of bins ")
        assert sentence.endswith(".")


def test_a_network_that_declares_nothing_can_do_nothing():
    assert abilities_of(object()) == Abilities()
