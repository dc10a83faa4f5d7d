from collections.abc import Iterator
from dataclasses import replace
from itertools import count, islice
from pathlib import Path
from threading import Event
from typing import Literal

import pytest
import torch

from etnet.training import loop
from etnet.training.checkpoint import LAST, load_checkpoint
from etnet.training.config import (
    ContextConfig,
    DataConfig,
    LossConfig,
    OptimiserConfig,
    Stage,
    TrainConfig,
    TrainingError,
    ValidationConfig,
)
from etnet.training.data import stretches
from etnet.training.devices import ahead, numbers_of, on_host
from etnet.training.distributed import World
from etnet.training.run import begin, resume
from tests.training.micro import micro
from tests.training.other_device import OTHER, OtherDevice


def everything(out: Path, kind: Literal["adamw", "muon"] = "muon") -> TrainConfig:
    """A run with every term and every help switched on, some of its clips gamma-coded."""
    config = micro(
        out,
        stages=(Stage(6, size=(40, 48), clips=3),),
        data=DataConfig(windows=4, workers=0, gamma_share=0.4),
        context=ContextConfig(skip_drop=0.5, skip_drop_end=0.5, blind_share=1.0),
        loss=LossConfig(num_scored=2, temporal=0.5, context=1.0, alive=0.2),
        optimiser=OptimiserConfig(kind=kind, warm_up=2),
    )
    return replace(config, device=OTHER.type)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("kind", ["adamw", "muon"])
def test_an_update_happens_on_the_device_and_never_waits_for_it(tmp_path: Path, kind: Literal["adamw", "muon"]):
    config = everything(tmp_path, kind)
    run = begin(config, World())
    gammas = set()
    for stretch in islice(stretches(config, 0, [range(3)]), 4):
        gammas |= set(stretch.is_gamma)
        with OtherDevice() as device:
            run.step(stretch)
        assert device.waits == []
        assert device.num_computed > 1000
    assert gammas == {True, False}
    assert run.state is not None
    assert {tensor.device for tensor in run.state.tensors} == {OTHER}


@pytest.mark.filterwarnings("ignore:.*which is a no-op")  # torch's word on weights for a device that keeps no values
def test_after_a_checkpoint_no_update_waits_either(tmp_path: Path):
    home = replace(everything(tmp_path), device="cpu")
    loop.train(replace(home, stages=(Stage(2, size=(40, 48), clips=3),)))
    away = everything(tmp_path)
    run = resume(away, World(), tmp_path / LAST, changed=True)
    with OtherDevice() as device:
        run.step(next(stretches(away, 2, [range(3)])))
    assert device.waits == []


def test_a_whole_run_on_another_device_leaves_files_that_know_no_device(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    pinned: list[torch.Size] = []

    def pin(tensor: torch.Tensor) -> torch.Tensor:
        pinned.append(tensor.shape)
        return tensor

    monkeypatch.setattr(torch.Tensor, "pin_memory", pin)
    monkeypatch.setattr(loop, "decided_device", lambda wanted: wanted)
    validation = ValidationConfig(every=4, clips=1, windows=3, size=(40, 48), score_every=2, other_densities=(1.0,))
    config = replace(everything(tmp_path), validation=validation)
    with OtherDevice() as device:
        run = loop.train(config)
    assert run.device == OTHER
    assert device.waits
    assert len(pinned) == 3 * 6  # voxels, frames and beginnings of each update
    checkpoint = load_checkpoint(tmp_path / LAST)
    assert checkpoint.update == 6
    state = checkpoint.optimiser["state"].values()
    tensors = [
        *checkpoint.weights.values(),
        *checkpoint.averaged.values(),
        *checkpoint.reader.values(),
        *checkpoint.memory,
        *(value for found in state for value in found.values()),
    ]
    assert {tensor.device.type for tensor in tensors} == {"cpu"}


@pytest.mark.filterwarnings("ignore:.*which is a no-op")  # torch's word on weights for a device that keeps no values
def test_a_run_is_taken_up_on_another_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    config = micro(tmp_path, stages=(Stage(2, size=(40, 48)),))
    longer = replace(config, stages=(Stage(4, size=(40, 48)),), device="cpu")
    monkeypatch.setattr(loop, "decided_device", lambda wanted: wanted)
    loop.train(config)
    away = replace(config, device=OTHER.type)  # pyright: ignore[reportArgumentType]
    assert resume(away, World(), tmp_path / LAST).update == 2
    with pytest.raises(TrainingError, match="another stages"):
        resume(replace(longer, device=away.device), World(), tmp_path / LAST)


def test_a_gpu_that_is_not_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(TrainingError, match="torch finds no GPU here; train with --device cpu") as found:
        loop.train(replace(micro(tmp_path), device="cuda"))
    assert "\n" not in str(found.value)
    assert loop.train(replace(micro(tmp_path), device="auto", stages=(Stage(1, size=(40, 48)),))).config.device == "cpu"


def test_numbers_are_read_as_they_were_computed():
    lines = [{"loss": torch.tensor(0.1 * i), "rate": 1e-7 * i} for i in range(5)]
    assert numbers_of(lines) == [{"loss": float(line["loss"]), "rate": line["rate"]} for line in lines]
    assert numbers_of([]) == []


def test_what_is_brought_home_keeps_its_shape():
    moved = on_host({"a": [torch.ones(2), (torch.zeros(1), 0.9)], "b": "name"})
    assert isinstance(moved["a"], list)
    assert isinstance(moved["a"][1], tuple)
    assert (moved["a"][1][1], moved["b"]) == (0.9, "name")


def test_what_is_made_ahead_comes_in_order_and_once():
    made: list[int] = []

    def make(item: int) -> int:
        made.append(item)
        return 10 * item

    coming = ahead(iter(range(5)), make)
    assert next(coming) == 0
    assert list(coming) == [10, 20, 30, 40]
    assert made == [0, 1, 2, 3, 4]


def test_the_first_is_made_before_anybody_asks():
    is_made = Event()

    def make(item: int) -> int:
        is_made.set()
        return item

    coming = ahead(iter(range(2)), make)
    assert is_made.wait(60)
    assert list(coming) == [0, 1]


def test_an_end_before_the_last_makes_no_more_than_one_ahead():
    made: list[int] = []

    def make(item: int) -> int:
        made.append(item)
        return item

    coming = ahead(count(), make)
    assert [next(coming) for _ in range(3)] == [0, 1, 2]
    coming.close()
    assert made in ([0, 1, 2], [0, 1, 2, 3])


def test_an_error_ahead_is_raised_where_it_is_waited_for():
    def broken() -> Iterator[int]:
        yield 1
        raise OSError("the disk is gone")

    coming = ahead(broken(), lambda item: item)
    assert next(coming) == 1
    with pytest.raises(OSError, match="the disk is gone"):
        next(coming)
