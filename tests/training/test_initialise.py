from dataclasses import replace
from pathlib import Path

import pytest
import torch

from etnet.nets.attention import AttentionProbe
from etnet.nets.etnet import ETNet
from etnet.nets.firenet import FireNetConfig
from etnet.nets.presets import PRESETS, NetworkConfig, build_model
from etnet.nets.weights import save_weights
from etnet.training.config import Stage, TrainingError
from etnet.training.distributed import World
from etnet.training.initialise import DEEP_PATH, start_locally, take_fitting
from etnet.training.log import read_log
from etnet.training.loop import train
from etnet.training.run import begin
from etnet.training.watch import health_of, mean_cosine, mean_spread
from tests.training.micro import micro


@pytest.fixture(scope="module")
def local() -> ETNet:
    model = build_model("etnet-half")
    start_locally(model, torch.Generator().manual_seed(0))
    return model


def test_attention_begins_by_looking_somewhere_in_every_layer(local: ETNet):
    voxel = torch.randn(1, 5, 112, 112, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        pyramid, _ = local.encode(voxel)
        with health_of(local) as watch:
            _, attention = local.decode(pyramid, AttentionProbe())
    assert attention is not None
    health = watch.health(pyramid, attention)
    assert len(health.cosine) == 21
    assert max(health.cosine.values()) < 0.85
    assert max(health.spread.values()) < 0.85
    assert min(health.live_units.values()) > 0.5


def test_a_place_head_looks_near_its_token(local: ETNet):
    voxel = torch.zeros(1, 5, 112, 112)
    with torch.no_grad():
        pyramid, _ = local.encode(voxel)
        _, attention = local.decode(pyramid, AttentionProbe())
    assert attention is not None
    row, column = 7, 7
    weights = attention.rows("scale1.encoder.0.self", [row * 14 + column])[:2, 0].view(2, 14, 14)
    near = weights[:, row - 2 : row + 3, column - 2 : column + 3].sum((1, 2))
    assert (near > 2 * 25 / 196).all()
    assert near[1] > near[0]


def test_watching_does_not_change_the_frame(local: ETNet):
    with torch.no_grad():
        pyramid, _ = local.encode(torch.randn(1, 5, 40, 48))
        plain, _ = local.decode(pyramid)
        with health_of(local):
            watched, _ = local.decode(pyramid)
    assert torch.equal(plain, watched)


def test_parts_that_fit_are_taken_and_the_others_named():
    source, target = build_model("tiny"), build_model(replace(PRESETS["tiny"], bins=3))
    generator = torch.Generator().manual_seed(3)
    weights = {name: torch.randn(value.shape, generator=generator) for name, value in source.state_dict().items()}
    before = {name: value.clone() for name, value in target.state_dict().items()}
    left = take_fitting(target, weights, without=DEEP_PATH)
    assert "head.conv.weight" in left
    for name, value in target.state_dict().items():
        assert torch.equal(value, before[name] if name in left else weights[name])
        assert (name in left) == (name.startswith(DEEP_PATH) or name == "head.conv.weight")


@pytest.mark.parametrize("other", [FireNetConfig(), replace(PRESETS["tiny"], base_channels=8, dim=64)])
def test_weights_of_which_no_layer_fits_begin_no_run(tmp_path: Path, other: NetworkConfig):
    save_weights(build_model(other), tmp_path / "other.safetensors")
    with pytest.raises(TrainingError, match=r"no layer of this (FireNet|ETNet) fits the network"):
        begin(micro(tmp_path, start=tmp_path / "other.safetensors"), World())


def test_the_log_tells_what_a_run_did_not_take_from_its_start(tmp_path: Path):
    start, out = tmp_path / "start.safetensors", tmp_path / "run"
    config = micro(out, start=start, stages=(Stage(1, size=(40, 48)),), initialise="default")
    save_weights(build_model(replace(config.network, bins=3, heads=2, squash=4.0)), start)
    train(config)
    told = read_log(out)[0]["start"]
    assert told["fresh"] == ["head.conv.weight"]
    assert told["differs"] == {
        "bins": [3, 5],
        "heads": [2, config.network.heads],
        "squash": [4.0, 0.0],
    }


def test_cosine_and_spread_know_the_two_ends():
    uniform = torch.full((2, 6, 10), 0.1)
    assert mean_cosine(uniform) == pytest.approx(1.0)
    assert mean_spread(uniform) == pytest.approx(1.0)
    each_its_own = torch.eye(6, 10).expand(2, 6, 10)
    assert mean_cosine(each_its_own) == pytest.approx(0.0)
    assert mean_spread(each_its_own) == pytest.approx(0.1)


def test_a_run_can_begin_with_a_fresh_upsampler_and_all_else_kept(tmp_path: Path):
    weights = tmp_path / "weights.safetensors"
    config = micro(tmp_path, start=weights, initialise="upsampler")
    trained = build_model(config.network, torch.Generator().manual_seed(5))
    save_weights(trained, weights, {})
    model = begin(config, World()).model
    changed = {
        name.rsplit(".", 2)[0]
        for name, value in model.state_dict().items()
        if not torch.allclose(value, trained.state_dict()[name], atol=1e-2)
    }
    assert changed == {f"upsampler.{block}.conv" for block in range(3)}
