from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path

import pytest
import torch

from etnet.training import loop
from etnet.training.checkpoint import BEST, LAST, load_checkpoint
from etnet.training.config import TrainConfig, TrainingError, ValidationConfig
from etnet.training.export import exported
from etnet.training.log import read_log
from etnet.training.loop import train
from tests.training.micro import micro


def a_minute_a_look() -> Callable[[], float]:
    """A clock that is looked at once at the start and once after each update."""
    return (60.0 * minute for minute in count()).__next__


def _weights(config: TrainConfig) -> list[torch.Tensor]:
    checkpoint = load_checkpoint(config.out / LAST)
    moments = [value for state in checkpoint.optimiser["state"].values() for value in state.values()]
    return [*checkpoint.weights.values(), *checkpoint.averaged.values(), *checkpoint.memory, *moments]


def test_a_run_that_ran_out_of_minutes_goes_on_to_the_same_bits(tmp_path: Path):
    whole, parts = micro(tmp_path / "whole", log_every=1), micro(tmp_path / "parts", log_every=1)
    train(whole)
    assert train(replace(parts, minutes=2), clock=a_minute_a_look()).update == 2
    assert train(replace(parts, minutes=3), clock=a_minute_a_look()).update == 5
    assert train(parts).update == 6
    assert all(torch.equal(one, other) for one, other in zip(_weights(whole), _weights(parts), strict=True))
    rates = [
        [line["learning_rate"] for line in read_log(config.out) if line["kind"] == "train"] for config in (whole, parts)
    ]
    assert rates[0] == rates[1]
    assert len(rates[0]) == 6


def test_at_its_end_it_is_logged_validated_and_can_be_exported(tmp_path: Path):
    validation = ValidationConfig(every=100, clips=1, windows=3, size=(40, 48), score_every=2)
    config = micro(tmp_path, validation=validation, minutes=1, checkpoint_every=100, log_every=100)
    run = train(config, clock=a_minute_a_look())
    lines = [(line["kind"], line["update"]) for line in read_log(tmp_path)]
    assert lines == [("config", 0), ("validation", 0), ("train", 1), ("validation", 1)]
    checkpoint = load_checkpoint(tmp_path / LAST)
    assert (checkpoint.update, checkpoint.best) == (1, run.best)
    assert (tmp_path / BEST).exists()
    assert exported(tmp_path)[1]["updates"] == 1


def test_what_was_learned_is_safe_before_the_last_validation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def goes_away(journal: loop.Journal, is_last: bool) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(loop.Journal, "after_update", goes_away)
    with pytest.raises(KeyboardInterrupt):
        train(micro(tmp_path, minutes=1, checkpoint_every=100), clock=a_minute_a_look())
    assert load_checkpoint(tmp_path / LAST).update == 1


def test_a_run_that_ends_before_its_minutes_ends_as_ever(tmp_path: Path):
    assert train(micro(tmp_path, minutes=100), clock=a_minute_a_look()).update == 6


def test_no_minutes_are_refused(tmp_path: Path):
    with pytest.raises(TrainingError, match=r"minutes is 0; wanted more than 0"):
        micro(tmp_path, minutes=0)
