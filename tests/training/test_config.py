import json
from dataclasses import replace
from pathlib import Path

import pytest

from etnet.cli.main import main
from etnet.cli.train_options import parse
from etnet.training import loop
from etnet.training.config import (
    OptimiserConfig,
    Stage,
    TrainConfig,
    TrainingError,
    ValidationConfig,
    network_preset,
)
from etnet.training.recipes import RECIPES
from tests.training.micro import micro


def test_values_that_cannot_be_are_refused_by_name():
    with pytest.raises(TrainingError, match=r"Stage\.updates is -1"):
        Stage(-1)
    with pytest.raises(TrainingError, match="hold no update"):
        TrainConfig(Path("x"), stages=(Stage(0), Stage(0)))
    with pytest.raises(TrainingError, match="at least 32 pixels"):
        Stage(1, size=(16, 16))
    with pytest.raises(TrainingError, match=r"truncate is 7; it has to divide the 40 windows"):
        TrainConfig(Path("x"), truncate=7)
    with pytest.raises(TrainingError, match="learning_rate is 0"):
        OptimiserConfig(learning_rate=0)
    with pytest.raises(TrainingError, match="score_every is 0"):
        ValidationConfig(score_every=0)
    for name in ("log_every", "checkpoint_every"):
        with pytest.raises(TrainingError, match=f"{name} is 0"):
            TrainConfig(Path("x"), **{name: 0})
    with pytest.raises(TrainingError, match="normalise_voxels is set"):
        TrainConfig(Path("x"), network=replace(network_preset("tiny"), normalise_voxels=True))


def test_stages_follow_each_other(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(2), Stage(3)))
    assert [config.stage_at(update) for update in range(5)] == [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)]
    with pytest.raises(TrainingError, match="ends after 5 updates; there is no update 5"):
        config.stage_at(5)


def test_a_stage_without_updates_is_left_out(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(0), Stage(2), Stage(0)))
    assert [config.stage_at(update) for update in range(2)] == [(1, 0), (1, 1)]
    assert parse(["--stages.1.updates", "0"], "etnet train").train.updates == RECIPES["half"].stages[0].updates


@pytest.mark.parametrize("name", RECIPES)
def test_every_recipe_is_plain_json(name: str):
    plain = RECIPES[name].as_plain()
    assert json.loads(json.dumps(plain)) == plain


def test_the_papers_recipe_is_the_papers():
    paper = RECIPES["paper"]
    assert (paper.truncate, paper.loss.temporal_from, paper.loss.temporal) == (40, 2, 1.0)
    assert (paper.optimiser.learning_rate, paper.optimiser.decay) == (2e-4, 0.99)
    assert paper.stages[0].size == (112, 112)


def test_the_command_line_changes_any_field():
    options = parse(["--config", "tiny", "--out", "there", "--loss.l1", ".3", "--stages.0.updates", "9"], "etnet train")
    assert options.train.out == Path("there")
    assert options.train.loss.l1 == 0.3
    assert options.train.updates == 9
    assert options.train.network == RECIPES["tiny"].network


def test_an_unknown_recipe_is_one_line(capsys: pytest.CaptureFixture[str]):
    assert main(["train", "--config", "huge"]) == 1
    assert capsys.readouterr().err == "etnet: --config is huge; there are paper, half, wide, tiny\n"


def test_bf16_is_refused_where_it_is_slow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(loop, "bf16_is_worth_trying", lambda: False)
    with pytest.raises(TrainingError, match="multiplies bf16 slower"):
        loop.train(replace(micro(tmp_path), precision="bf16"))
