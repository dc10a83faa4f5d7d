"""The list of networks is complete, and says where weights come from."""

import subprocess
import sys

import pytest

from etnet.bundled import models
from etnet.errors import WeightsError
from etnet.nets.listing import LISTED, where_to_get
from etnet.nets.presets import PRESETS
from etnet.nets.weights import load_model


def test_every_bundled_network_is_listed_and_every_listed_one_is_a_preset():
    assert {network.name for network in LISTED if network.is_bundled} == {path.stem for path in models()}
    assert {network.name for network in LISTED} <= set(PRESETS)


def test_a_network_without_weights_says_where_they_are():
    with pytest.raises(WeightsError, match=r"uzh-rpg/rpg_e2vid.*etnet convert CHECKPOINT"):
        load_model("e2vid")
    with pytest.raises(WeightsError, match="nobody published weights of 'e2vid-res6'"):
        load_model("e2vid-res6")
    assert "event-pienet" in where_to_get("pie-net")


def test_the_list_needs_no_torch():
    code = "import sys, etnet.nets.listing, etnet.nets.metadata; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
