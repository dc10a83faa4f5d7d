"""What bundled weights have to do: TPA and its attention matter, nothing is dead, rivals are beaten."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from etnet.bundled import samples
from etnet.evaluation.evaluate import evaluate
from etnet.evaluation.lpips import load_lpips
from etnet.evaluation.protocol import PAPER
from etnet.evaluation.scores import Scores
from etnet.events.open import open_recording
from etnet.nets.blocks import ConvReLU
from etnet.nets.etnet import ETNet
from etnet.nets.runtime import Runtime, apply_runtime
from etnet.nets.transformer import FeedForward
from etnet.nets.weights import load_model
from etnet.training.films import Film
from etnet.training.recipes import HALF
from etnet.training.validate import Scores as Validation
from etnet.training.validate import recorded_film, validate
from tests.real_data import real_file

pytestmark = pytest.mark.slow

FIRENET_PLUS = {"mse": 0.0437, "ssim": 0.567, "lpips": 0.324, "affine lpips": 0.274}
"""Published weights on `slider_depth`, `paper` protocol."""


@pytest.fixture(scope="module")
def model() -> ETNet:
    network = load_model()
    assert isinstance(network, ETNet)
    apply_runtime(network, Runtime())  # in plain torch each layer is called, and what it gives can be watched
    return network


@pytest.fixture(scope="module")
def films() -> list[Film]:
    """The bundled recordings, whose pictures no training saw."""
    config = replace(HALF, validation=replace(HALF.validation, windows=16))
    return [recorded_film(path, config) for path in samples()]


@pytest.fixture(scope="module")
def validation(model: ETNet, films: list[Film]) -> Validation:
    return validate(model, films, 5, load_lpips())


def test_without_tpa_frames_are_worse(validation: Validation):
    assert validation.lpips["without_context"] - validation.lpips["as_is"] >= 0.02


def test_where_attention_looks_matters(validation: Validation):
    assert validation.lpips["uniform_attention"] - validation.lpips["as_is"] >= 0.005


def test_what_tpa_tells_differs_from_place_to_place(validation: Validation):
    assert validation.lpips["mean_context"] - validation.lpips["as_is"] >= 0.005


def test_attention_differs_between_queries(validation: Validation):
    coarse = [value for site, value in validation.health.cosine.items() if not site.startswith("scale1")]
    assert len(coarse) == 14
    assert sum(coarse) / len(coarse) < 0.9


def test_no_layer_is_more_than_half_dead(model: ETNet, films: list[Film]):
    with _fired(model) as fired, torch.no_grad():
        for film in films:
            state = None
            for index, voxel in enumerate(film.voxels):
                pyramid, state = model.encode(voxel[None], state)
                if index % 5 == 4:
                    model.decode(pyramid)
    assert len(fired) == 4 + 3 + 15
    shares = {name: float(units.float().mean()) for name, units in fired.items()}
    assert min(shares.values()) > 0.5, shares


@pytest.mark.real
def test_they_beat_firenet_plus_and_a_constant_grey_by_every_measure(model: ETNet):
    with open_recording(real_file("ecd_slider_depth/slider_depth.zip")) as recording:
        scores = evaluate(model, recording, PAPER, estimates_flow=False)
    for rival in (FIRENET_PLUS, _measures(scores, "constant grey", "constant grey")):
        ours = _measures(scores, "as it is", "best affine per frame")
        for name, value in rival.items():
            assert (ours[name] > value) == (name == "ssim"), (name, ours[name], value)


def _measures(scores: Scores, row, affine_row) -> dict[str, float]:
    return {
        **{name: scores.mean(name, row) for name in ("mse", "ssim", "lpips")},
        "affine lpips": scores.mean("lpips", affine_row),
    }


@contextmanager
def _fired(model: ETNet) -> Iterator[dict[str, Tensor]]:
    """By layer with a ReLU: which of its units were ever above zero."""
    fired: dict[str, Tensor] = {}

    def keep(name: str, channels_at: int):
        def hook(module: nn.Module, inputs: object, output: Tensor) -> None:
            now = (output > 0).transpose(0, channels_at).flatten(1).any(1)
            fired[name] = fired.get(name, torch.zeros_like(now)) | now

        return hook

    handles = []
    for name, module in model.named_modules():
        if isinstance(module, ConvReLU):
            handles.append(module.register_forward_hook(keep(name, 1)))
        if isinstance(module, FeedForward):
            handles.append(module.expand.register_forward_hook(keep(name, -1)))
    try:
        yield fired
    finally:
        for handle in handles:
            handle.remove()
