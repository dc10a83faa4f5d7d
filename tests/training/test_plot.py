import json
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from etnet.cli.main import main
from etnet.render.chart import LEFT, RIGHT, WIDTH
from etnet.training.config import TrainingError
from etnet.training.log import LOG
from etnet.training.plot import plot_runs

SVG = "{http://www.w3.org/2000/svg}"
CONDITIONS = ("as_is", "without_context")


def run(folder: Path, losses: Sequence[float], validated: Sequence[float] = ()) -> Path:
    """A run's log: a line each 20 updates, validation before the first and after the last."""
    train = [{"kind": "train", "update": 20 * (i + 1), "perceptual": loss} for i, loss in enumerate(losses)]
    seen = zip((0, 20 * len(losses)), validated, strict=False)
    lpips = [{"kind": "validation", "update": at, "lpips": dict.fromkeys(CONDITIONS, value)} for at, value in seen]
    folder.mkdir()
    (folder / LOG).write_text("".join(json.dumps(line) + "\n" for line in (*lpips, *train)))
    return folder


def curves(svg: str) -> list[list[tuple[float, float]]]:
    lines = ElementTree.fromstring(svg).findall(f".//{SVG}polyline")
    pairs = [[point.split(",") for point in line.attrib["points"].split()] for line in lines]
    return [[(float(x), float(y)) for x, y in line] for line in pairs]


def test_a_falling_loss_is_a_falling_line_to_the_last_update(tmp_path: Path) -> None:
    (line,) = curves(plot_runs([run(tmp_path / "one", [0.5, 0.4, 0.3, 0.2, 0.1])]))
    assert len(line) == 5
    assert line[-1][0] == WIDTH - RIGHT
    heights = [y for _, y in line]
    assert heights == sorted(heights)  # y grows downwards
    assert len(set(heights)) == 5


def test_runs_that_followed_one_another_stand_behind_one_another(tmp_path: Path) -> None:
    svg = plot_runs([run(tmp_path / "first", [0.5] * 3, (0.6, 0.5)), run(tmp_path / "then", [0.4], (0.5, 0.4))])
    loss, as_is, without = curves(svg)
    width = WIDTH - LEFT - RIGHT
    assert [x - LEFT for x, _ in loss] == pytest.approx([width * share for share in (0.25, 0.5, 0.75, 1)])
    assert len(as_is) == len(without) == 4
    assert "first" in svg
    assert "then" in svg


def test_one_validation_is_no_curve(tmp_path: Path) -> None:
    assert "held-out" not in plot_runs([run(tmp_path / "one", [0.5, 0.4], (0.6,))])


def test_a_folder_without_a_log_is_named(tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"nothing.*no log"):
        plot_runs([tmp_path / "nothing"])


def test_the_command_draws_a_run(tmp_path: Path) -> None:
    folder, target = run(tmp_path / "one", [0.5, 0.4]), tmp_path / "curves.svg"
    assert main(["train", "--out", str(folder), "--curves", str(target)]) == 0
    assert target.read_text() == plot_runs([folder])
