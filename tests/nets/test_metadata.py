"""Whatever a weights file's metadata say: a model, or one line."""

import json
import struct
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from etnet.errors import WeightsError
from etnet.nets.etnet import ETNetConfig
from etnet.nets.metadata import config_of_plain, parse_object
from etnet.nets.pienet import PIENetConfig
from etnet.nets.presets import build_model
from etnet.nets.weights import FORMAT, load_weights, read_card, save_weights


def stored(tmp_path: Path, **metadata: str) -> Path:
    """A tiny network's weights under other metadata."""
    path, model = tmp_path / "x.safetensors", build_model("tiny")
    save_weights(model, path, {"title": "tiny"})
    plain = {name: tensor.contiguous() for name, tensor in model.state_dict().items()}
    config = json.dumps({"base_channels": 4, "dim": 32, "heads": 4})
    save_file(plain, path, {"format": FORMAT, "architecture": "ETNet", "config": config, "card": "{}"} | metadata)
    return path


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ("[" * 100_000, "nested more than 32 deep"),
        ('{"a":' * 40 + "1" + "}" * 40, "nested more than 32 deep"),
        ("9" * 5000, "whole number of 5000 digits"),
        ('{"bins": ' + "9" * 5000 + "}", "whole number of 5000 digits"),
        ("{", "no JSON"),
        ("", "no JSON"),
        ("null", "is a NoneType, wanted a JSON object"),
        ("[1]", "is a list, wanted a JSON object"),
        (json.dumps({"nonsense": 1}), "no field 'nonsense'"),
        (json.dumps({"bins": "five"}), "bins is 'five'; wanted a whole number"),
        (json.dumps({"bins": True}), "bins is True"),
        (json.dumps({"bins": None}), "bins is None"),
        (json.dumps({"bins": 10**12}), "bins is 1000000000000"),
        ('{"dropout": Infinity}', "dropout is None; wanted a number"),
        ('{"dropout": 1e999}', "dropout is None; wanted a number"),
        (json.dumps({"bins": -1}), "at least 1"),
        (json.dumps({"heads": 0}), "does not divide into 0 heads"),
        (json.dumps({"encoder_depth": 60_000}), "depths are 60000"),
        (json.dumps({"positions": "spiral"}), "positions is 'spiral'; wanted 'raster' or 'grid'"),
        (json.dumps({"base_channels": 60_000, "dim": 480_000}), "dim is 480000"),
        (json.dumps({"base_channels": 8_000, "dim": 64_000}), "first missing parameter"),
        ('"' + "x" * (1 << 20) + '"', "characters"),
    ],
)
def test_hostile_configurations_are_one_line(config: str, words: str, tmp_path: Path):
    with pytest.raises(WeightsError, match=words) as failure:
        load_weights(stored(tmp_path, config=config))
    assert "\n" not in str(failure.value)
    assert len(str(failure.value)) < 400


def test_hostile_cards_and_missing_keys_are_one_line(tmp_path: Path):
    for card in ("[" * 100_000, "[]", "nonsense", "1" * 6000):
        with pytest.raises(WeightsError, match="its card"):
            read_card(stored(tmp_path, card=card))
    with pytest.raises(WeightsError, match="is a 'Nothing'"):
        load_weights(stored(tmp_path, architecture="Nothing"))
    path = stored(tmp_path)
    save_file({"a": torch.ones(1)}, path, {"format": FORMAT})
    with pytest.raises(WeightsError, match="known are ETNet"):
        load_weights(path)


def test_damaged_headers_are_one_line(tmp_path: Path):
    path = tmp_path / "x.safetensors"
    for content in (b"", b"\0" * 8, struct.pack("<Q", 1 << 60), struct.pack("<Q", 5) + b"[1,2]", b"{" * 4000):
        path.write_bytes(content)
        with pytest.raises(WeightsError) as failure:
            load_weights(path)
        assert "\n" not in str(failure.value)
    with pytest.raises(WeightsError, match="no regular file"):
        read_card(tmp_path)


def test_a_card_may_hold_infinity_and_gives_none(tmp_path: Path):
    assert read_card(stored(tmp_path, card='{"best": Infinity, "worst": NaN, "updates": 3}')) == {
        "best": None,
        "worst": None,
        "updates": 3,
    }


@pytest.mark.parametrize("broken", [float("nan"), float("inf"), -float("inf")])
def test_weights_that_are_no_numbers_are_refused_by_their_layer(broken: float, tmp_path: Path):
    model, path = build_model("tiny"), tmp_path / "x.safetensors"
    with torch.no_grad():
        model.upsampler[1].conv.conv.weight[0, 0, 0, 0] = broken
    save_weights(model, path)
    with pytest.raises(WeightsError, match=r"upsampler\.1\.conv\.conv\.weight holds 1 of \d+ values that are NaN"):
        load_weights(path)


def test_what_is_written_is_read(tmp_path: Path):
    model = build_model("tiny")
    save_weights(model, tmp_path / "x.safetensors", {"title": "tiny", "events_per_pixel": [0.1, 1.0]})
    assert load_weights(tmp_path / "x.safetensors").config == model.config
    assert read_card(tmp_path / "x.safetensors") == {"title": "tiny", "events_per_pixel": [0.1, 1.0]}


def test_lists_become_the_tuples_that_a_configuration_holds():
    config = config_of_plain(PIENetConfig, parse_object('{"channels": [4, 8], "pools": [2]}', "x"), "x")
    assert config == PIENetConfig(channels=(4, 8), pools=(2,))
    with pytest.raises(WeightsError, match="a list of at most 32, each a whole number"):
        config_of_plain(PIENetConfig, {"pools": ["two"]}, "x")
    assert config_of_plain(ETNetConfig, {"dropout": 0}, "x").dropout == 0
