"""The options that errors name are the options that exist, and they do what the error promised."""

import numpy as np
import pytest

from etnet.cli.main import main


def _unsorted(path):
    rows = np.stack([np.linspace(0, 1, 300), np.arange(300) % 7, np.arange(300) % 5, np.arange(300) % 2], 1)
    rows[[10, 200]] = rows[[200, 10]]
    np.savetxt(path, rows, fmt=["%.6f", "%d", "%d", "%d"])
    return path


def test_what_an_error_advises_helps(tmp_path, capsys):
    path = _unsorted(tmp_path / "events.txt")
    assert main(["inspect", str(path)]) == 1
    assert "--sort" in capsys.readouterr().err
    assert main(["inspect", str(path), "--sort", "--assume", "width=20,height=12", "--json"]) == 0
    assert '"width": 20' in capsys.readouterr().out


def test_a_part_of_the_sensor_can_be_seen(tmp_path, capsys):
    path = _unsorted(tmp_path / "events.txt")
    options = ["--sort", "--assume", "width=20,height=12", "--region", "0", "0", "8", "6", "--downsample", "2"]
    assert main(["inspect", str(path), *options, "--json"]) == 0
    assert '"width": 4' in capsys.readouterr().out


@pytest.mark.parametrize("text", ["640x480", "width=3", "height=4,width=3"])
def test_a_sensor_that_is_not_understood_is_told_how(text, tmp_path, capsys):
    assert main(["inspect", str(_unsorted(tmp_path / "events.txt")), "--assume", text]) == 1
    assert "width=640,height=480" in capsys.readouterr().err


def test_usage_and_unknown_commands_have_their_exit_codes(capsys):
    assert main([]) == 2
    assert main(["--help"]) == 0
    assert main(["nonsense"]) == 2
    assert "reconstruct" in capsys.readouterr().out
