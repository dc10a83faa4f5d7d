"""A network of somebody's own is played after one function, and what is wrong with its file is one line."""

import re
from pathlib import Path

import numpy as np
import pytest

from app.catalogue.recordings import Catalogue
from app.config import ViewerConfig
from app.engine.engine import Engine
from app.engine.playbacks import load_network
from app.engine.requests import FrameRequest
from etnet.errors import ModelError, WeightsError
from etnet.inspection.anatomy import anatomy_of
from etnet.nets.own import load_own
from etnet.nets.presets import build_model
from etnet.nets.weights import save_weights
from etnet.windows import ByCount
from tests.app.fakes import Inbox
from tests.evaluation.recordings import made_up, write_event_utils

DOCUMENTED = Path(__file__).resolve().parents[3] / "docs" / "own_network.md"


@pytest.fixture
def own(tmp_path):
    """The function of the documentation, in a file as it says."""
    text = DOCUMENTED.read_text()
    function = re.search(r"^def step\(.*?\n\n", text, re.DOTALL | re.MULTILINE)
    network = re.search(r'`(network = Adapter\(step, name="leaky integrator"\))`', text)
    path = tmp_path / "my_network.py"
    path.write_text(f"import torch\nfrom etnet.nets.adapter import Adapter\n\n\n{function[0]}\n{network[1]}\n")
    return path


def test_the_documented_function_is_the_main_network_of_the_viewer(own, tmp_path):
    write_event_utils(made_up(), tmp_path / "recording.h5")
    catalogue = Catalogue(ViewerConfig(file=tmp_path / "recording.h5", model=str(own)))
    assert [model.title for model in catalogue.models()][:2] == ["my_network", "etnet-half"]
    engine, inbox = Engine(catalogue, 64 << 20, threads=1, prefetches=False), Inbox()
    try:
        ids = catalogue.entries()[0].id, catalogue.models()[0].id
        engine.request("ada", FrameRequest(*ids, "fp32", ByCount(100), 9), inbox)
        late = inbox.ready(9, timeout=60)
        engine.request("ada", FrameRequest(*ids, "fp32", ByCount(100), 4), inbox)
        early = inbox.ready(4, timeout=60)
    finally:
        engine.stop()
    assert late.is_exact
    with catalogue.open(ids[0]) as recording:
        brightness = np.zeros((40, 48))
        for index in range(10):
            events = recording.read(index * 100, (index + 1) * 100)
            brightness *= 0.95
            np.add.at(brightness, (events.y, events.x), 0.1 * events.p.astype(float))
            if index == 4:
                assert early.frame == pytest.approx(1 / (1 + np.exp(-brightness)), abs=1e-5)
        assert late.frame == pytest.approx(1 / (1 + np.exp(-brightness)), abs=1e-5)


def test_a_network_of_ones_own_has_one_name_in_the_list_and_in_every_inspector(own, tmp_path):
    write_event_utils(made_up(), tmp_path / "recording.h5")
    entry = Catalogue(ViewerConfig(file=tmp_path / "recording.h5", model=str(own))).models()[0]
    assert anatomy_of(load_network(entry, "fp32", "cpu")).name == entry.title == "my_network"


@pytest.mark.parametrize(("text", "said"), [
    ("x = 1 +", "cannot be run"),
    ("1 / 0", "ZeroDivisionError"),
    ("x = 1", "defines no 'network'"),
    ("network = 7", "is a int"),
])  # fmt: skip
def test_a_file_that_holds_no_network_is_one_line_with_its_name(tmp_path, text, said):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(ModelError, match=said) as caught:
        load_own(path)
    assert "mine.py" in str(caught.value)


def test_weights_in_the_data_folder_are_offered_and_broken_ones_are_not(tmp_path):
    save_weights(build_model("tiny"), tmp_path / "mine.safetensors", {"title": "my weights"})
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "broken.safetensors").write_bytes(b"nothing of the kind")
    titles = [model.title for model in Catalogue(ViewerConfig(data=tmp_path)).models()]
    assert titles == ["etnet-half", "pie-net-lite", "my weights", "leaky integrator"]
    named = Catalogue(ViewerConfig(data=tmp_path, model=str(tmp_path / "mine.safetensors"))).models()
    assert [model.title for model in named].count("my weights") == 1
    assert named[0].title == "my weights"
    with pytest.raises(WeightsError, match="not a weights file"):
        Catalogue(ViewerConfig(model=str(tmp_path / "deep" / "broken.safetensors")))
    assert Catalogue(ViewerConfig(model="leaky-integrator")).models()[0].id == "leaky-integrator"


def test_a_published_network_that_is_not_bundled_is_told_where_its_weights_come_from():
    with pytest.raises(WeightsError, match=r"^--model e2vid: .*rpg_e2vid.*etnet convert"):
        Catalogue(ViewerConfig(model="e2vid"))
    with pytest.raises(WeightsError, match="no such weights file"):
        Catalogue(ViewerConfig(model="e2vidd"))
