"""A released checkpoint becomes our model and gives the released code's frames; nothing in it is run."""

import pickle
import sys
import types
from pathlib import Path, PosixPath

import pytest
import torch

from etnet.cli.main import main
from etnet.errors import WeightsError
from etnet.nets.checkpoint_reader import Foreign, read_checkpoint, state_dict_of
from etnet.nets.convert import convert_checkpoint
from etnet.nets.presets import PRESETS, build_model
from etnet.nets.released import rename_released
from etnet.nets.weights import load_model, load_strictly, load_weights, save_weights
from tests.reference import released_etnet


@pytest.fixture
def config_parser(monkeypatch: pytest.MonkeyPatch) -> type:
    """A module `parse_config` as in the released code, which the reader must not need, and the class it pickles."""
    module = types.ModuleType("parse_config")

    class ConfigParser:
        def __init__(self) -> None:
            self._config = {"arch": {"type": "EITR", "args": {"eitr_kwargs": {"num_bins": 5, "norm": "none"}}}}
            self._save_dir = PosixPath("/somewhere/else")

    ConfigParser.__module__, ConfigParser.__qualname__ = "parse_config", "ConfigParser"
    module.ConfigParser = ConfigParser  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "parse_config", module)
    return ConfigParser


@pytest.fixture(params=[True, False], ids=["zip", "legacy"])
def checkpoint(tmp_path: Path, config_parser: type, request: pytest.FixtureRequest, monkeypatch) -> Path:
    """A checkpoint as the released trainer writes it."""
    path = tmp_path / "official.pth.tar"
    content = {
        "arch": "EITR",
        "epoch": 300,
        "state_dict": released_etnet.random_state(),
        "optimizer": {"state": {}, "param_groups": [{"lr": 1e-4}]},
        "monitor_best": 0.1,
        "config": config_parser(),
    }
    torch.save(content, path, _use_new_zipfile_serialization=request.param)
    monkeypatch.delitem(sys.modules, "parse_config")
    return path


@pytest.mark.parametrize("size", [(24, 32), (21, 38), (17, 9)])
def test_converted_weights_give_the_released_codes_frames(checkpoint: Path, size: tuple[int, int], tmp_path: Path):
    target = tmp_path / "ours.safetensors"
    assert main(["convert", str(checkpoint), str(target)]) == 0
    written = target.read_bytes()
    assert main(["convert", str(checkpoint), str(target), "--heads", "3"]) == 1  # what is there stays
    assert target.read_bytes() == written
    assert main(["convert", str(checkpoint), str(target), "--overwrite"]) == 0
    model = load_model(target)
    voxels = list(torch.randn(4, 5, *size, generator=torch.Generator().manual_seed(5)) * 2)
    expected = released_etnet.run(released_etnet.random_state(), voxels)
    state = None
    with torch.inference_mode():
        for voxel, frame in zip(voxels, expected, strict=True):
            step = model(voxel[None], state)
            state = step.state
            torch.testing.assert_close(step.frame[0, 0], frame, atol=1e-5, rtol=0)


def test_reading_a_checkpoint_runs_nothing_of_it(tmp_path: Path):
    marker = tmp_path / "was-run"

    class Attack:
        def __reduce__(self):
            return (exec, (f"open({str(marker)!r}, 'w').close()",))

    path = tmp_path / "evil.pth"
    torch.save({"state_dict": {"weight": torch.ones(2)}, "config": Attack()}, path)
    content = read_checkpoint(path)
    assert isinstance(content["config"], Foreign)
    assert torch.equal(state_dict_of(content, "evil.pth")["weight"], torch.ones(2))
    assert not marker.exists()


@pytest.mark.parametrize("content", [b"", b"hello", pickle.dumps([1, 2, 3]), b"PK\x03\x04 truncated"])
def test_files_that_are_no_checkpoints_are_refused_in_one_line(tmp_path: Path, content: bytes):
    path = tmp_path / "broken.pth"
    path.write_bytes(content)
    with pytest.raises(WeightsError, match=r"broken\.pth") as error:
        convert_checkpoint(path)
    assert "\n" not in str(error.value)


def test_another_networks_checkpoint_is_named_as_such(tmp_path: Path):
    path = tmp_path / "other.pth"
    torch.save({"state_dict": {"layer.weight": torch.ones(2)}}, path)
    with pytest.raises(WeightsError, match="not an ET-Net"):
        convert_checkpoint(path)


def test_every_released_name_has_a_name_here_and_they_are_254():
    state = {rename_released(name) for name in released_etnet.random_state()}
    assert state == set(build_model("etnet").state_dict())
    assert len(state) == 254


def test_a_strict_load_names_the_first_missing_and_the_first_unexpected():
    model, state = build_model("tiny"), dict(build_model("tiny").state_dict())
    state["surplus"] = state.pop("tail.bias")
    with pytest.raises(WeightsError, match=r"missing parameter tail\.bias, first unexpected surplus"):
        load_strictly(model, state, "a.safetensors")
    state = dict(build_model("tiny").state_dict())
    state["tail.bias"] = torch.zeros(2)
    with pytest.raises(WeightsError, match=r"tail\.bias is \(2,\), wanted \(1,\)"):
        load_strictly(model, state, "a.safetensors")


def test_weights_come_back_with_their_configuration_and_card(tmp_path: Path):
    model, path = build_model("tiny"), tmp_path / "mine.safetensors"
    save_weights(model, path, {"title": "mine"}, dtype=torch.float32)
    again = load_weights(path)
    assert again.config == PRESETS["tiny"]
    assert again.card == {"title": "mine"}
    assert again.name == "mine"
    assert all(torch.equal(value, again.state_dict()[name]) for name, value in model.state_dict().items())
    assert list(tmp_path.iterdir()) == [path]


def test_the_default_model_loads_and_etnet_says_how_to_convert():
    assert load_model().config == PRESETS["etnet-half"]
    with pytest.raises(WeightsError, match=r"etnet convert CHECKPOINT\.pth etnet"):
        load_model("etnet")
    with pytest.raises(WeightsError, match="bundled are etnet-half, pie-net-lite"):
        load_model("nonsense")


def test_a_foreign_safetensors_file_is_told_from_ours(tmp_path: Path):
    from safetensors.torch import save_file

    path = tmp_path / "foreign.safetensors"
    save_file({"a": torch.ones(1)}, path)
    with pytest.raises(WeightsError, match="metadata"):
        load_model(path)
    path.write_bytes(b"nothing")
    with pytest.raises(WeightsError, match="safetensors"):
        load_model(path)
