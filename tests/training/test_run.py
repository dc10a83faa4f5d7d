import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import pytest
import torch

from etnet.errors import EtnetError
from etnet.nets.weights import load_weights, save_weights
from etnet.training import loop
from etnet.training.checkpoint import LAST, load_checkpoint, save_checkpoint
from etnet.training.config import (
    DataConfig,
    LossConfig,
    OptimiserConfig,
    Stage,
    TrainConfig,
    TrainingError,
    ValidationConfig,
)
from etnet.training.distributed import World
from etnet.training.export import exported
from etnet.training.log import read_log
from etnet.training.loop import train
from etnet.training.run import begin, learning_rate_at, resume
from tests.training.micro import micro


def _same(first: Path, second: Path) -> bool:
    one, other = load_checkpoint(first / LAST), load_checkpoint(second / LAST)
    moments = [
        [value for state in checkpoint.optimiser["state"].values() for value in state.values()]
        for checkpoint in (one, other)
    ]
    pairs = [
        *zip(one.weights.values(), other.weights.values(), strict=True),
        *zip(one.averaged.values(), other.averaged.values(), strict=True),
        *zip(*moments, strict=True),
        *zip(one.memory, other.memory, strict=True),
    ]
    return one.update == other.update and all(torch.equal(a, b) for a, b in pairs)


@pytest.mark.parametrize("kind", ["adamw", "muon"])
def test_a_run_that_stopped_goes_on_to_the_same_bits(tmp_path: Path, kind: Literal["adamw", "muon"]):
    changes = {
        "loss": LossConfig(num_scored=2, temporal=0.5, temporal_after=2),
        "optimiser": OptimiserConfig(kind=kind, warm_up=2),
    }
    whole = micro(tmp_path / "whole", **changes)
    train(whole)
    for stop in (1, 4):
        parts = micro(tmp_path / f"parts{stop}", **changes)
        run = begin(parts, World())
        parts.out.mkdir()
        from etnet.training.data import stretches

        for stretch in stretches(parts, 0, [range(2)]):
            run.step(stretch)
            if run.update == stop:
                break
        save_checkpoint(run.checkpoint(), parts.out / LAST)
        train(parts)
        assert _same(whole.out, parts.out)


def test_a_run_can_be_taken_up_across_stages(tmp_path: Path):
    stages = (Stage(3, size=(40, 48)), Stage(3, size=(48, 56), clips=1))
    whole, parts = micro(tmp_path / "whole", stages=stages), micro(tmp_path / "parts", stages=stages)
    train(whole)
    run = begin(parts, World())
    parts.out.mkdir()
    from etnet.training.data import stretches

    for stretch in stretches(parts, 0, [range(2), range(1)]):
        if run.update == 3:
            break
        run.step(stretch)
    save_checkpoint(run.checkpoint(), parts.out / LAST)
    train(parts)
    assert _same(whole.out, parts.out)


def wait_for(holds: Callable[[], bool], seconds: float) -> None:
    """Return when it holds, or after `seconds`."""
    deadline = time.monotonic() + seconds
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.02)


KILLED = """
import sys
from pathlib import Path
from etnet.training.loop import train
from tests.training.micro import micro
from etnet.training.config import Stage
train(micro(Path(sys.argv[1]), stages=(Stage(40, size=(40, 48)),)))
"""


@pytest.mark.slow
def test_a_killed_run_goes_on_to_the_same_bits(tmp_path: Path):
    command = [sys.executable, "-c", KILLED, str(tmp_path / "killed")]
    root = Path(__file__).resolve().parents[2]
    process = subprocess.Popen(command, cwd=root, env={**os.environ, "OMP_NUM_THREADS": "1"})
    last = tmp_path / "killed" / LAST
    wait_for(last.exists, 120)
    time.sleep(0.15)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert load_checkpoint(last).update < 40
    config = micro(tmp_path / "killed", stages=(Stage(40, size=(40, 48)),))
    train(config)
    train(replace(config, out=tmp_path / "whole"))
    assert _same(tmp_path / "killed", tmp_path / "whole")
    assert [line["update"] for line in read_log(config.out)] == [
        line["update"] for line in read_log(tmp_path / "whole")
    ]


WITH_WORKER = """
import sys
from dataclasses import replace
from pathlib import Path
from etnet.training.config import Stage
from etnet.training.loop import train
from tests.training.micro import micro
if __name__ == "__main__":
    config = micro(Path(sys.argv[1]), stages=(Stage(10_000, size=(64, 96)),))
    train(replace(config, data=replace(config.data, workers=1)))
"""


def _is_running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="reads children from /proc")
def test_a_killed_run_leaves_no_worker_behind(tmp_path: Path):
    script = tmp_path / "run.py"
    script.write_text(WITH_WORKER)
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(root)}
    process = subprocess.Popen([sys.executable, str(script), str(tmp_path / "killed")], cwd=root, env=environment)
    wait_for((tmp_path / "killed" / LAST).exists, 120)
    children = [int(child) for task in Path(f"/proc/{process.pid}/task").iterdir() for child in _children(task)]
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert children
    wait_for(lambda: not any(map(_is_running, children)), 30)
    assert not any(map(_is_running, children))


def _children(task: Path) -> list[str]:
    return (task / "children").read_text().split()


def test_a_torn_write_leaves_the_old_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    config = micro(tmp_path, stages=(Stage(1, size=(40, 48)),))
    run = train(config)

    def torn(value: object, file) -> None:
        file.write(b"half of it")
        raise OSError("no space left on device")

    monkeypatch.setattr(torch, "save", torn)
    with pytest.raises(EtnetError, match="no space"):
        save_checkpoint(run.checkpoint(), tmp_path / LAST)
    assert load_checkpoint(tmp_path / LAST).update == 1
    assert not list(tmp_path.glob("*.tmp"))


def test_a_run_that_diverges_keeps_its_last_finite_checkpoint(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(3, size=(40, 48)),))
    train(config)
    kept = (tmp_path / LAST).read_bytes()
    longer = replace(config, stages=(Stage(6, size=(40, 48)),))
    too_fast = replace(longer, optimiser=replace(config.optimiser, learning_rate=1e30))
    with pytest.raises(TrainingError, match=r"update 6: the run has diverged .* lower --optimiser"):
        train(too_fast, changed=True)
    assert (tmp_path / LAST).read_bytes() == kept
    assert train(longer, changed=True).update == 6


def test_the_best_score_is_one_on_the_present_validation(tmp_path: Path):
    validation = ValidationConfig(every=1, clips=1, windows=2, size=(40, 48), score_every=1)
    config = micro(tmp_path, stages=(Stage(1, size=(40, 48)),), validation=validation)
    best = train(config).best
    assert best < math.inf

    def taken_up(now: TrainConfig) -> float:
        return resume(now, World(), tmp_path / LAST, changed=True).best

    longer, data = replace(config, stages=(Stage(2, size=(40, 48)),)), config.data
    for same in (
        longer,
        replace(longer, validation=replace(validation, every=5, other_densities=(1.0,))),
        replace(longer, data=replace(data, workers=1, density=(0.1, 2.0))),
    ):
        assert taken_up(same) == best
    for other in (
        replace(longer, validation=replace(validation, windows=3)),
        replace(longer, validation=replace(validation, recordings=(tmp_path / "real.h5",))),
        replace(longer, data=replace(data, target_tone="srgb")),
        replace(longer, data=replace(data, photos=tmp_path)),
    ):
        assert taken_up(other) == math.inf


def test_a_process_that_writes_no_log_keeps_no_numbers(tmp_path: Path):
    assert train(micro(tmp_path), World(rank=1)).recent == []
    assert not list(tmp_path.iterdir())


def test_another_config_is_refused_by_name(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(1, size=(40, 48)),))
    train(config)
    with pytest.raises(TrainingError, match="made with another seed"):
        train(replace(config, seed=5))
    longer = replace(config, stages=(Stage(2, size=(40, 48)),))
    assert train(longer, changed=True).update == 2


def test_a_changed_weight_decay_holds_from_there_on(tmp_path: Path):
    for kind in ("adamw", "muon"):
        config = micro(tmp_path / kind, stages=(Stage(1, size=(40, 48)),))
        config = replace(config, optimiser=replace(config.optimiser, kind=kind, weight_decay=0.25))
        train(config)
        longer = replace(config, stages=(Stage(2, size=(40, 48)),))
        run = train(replace(longer, optimiser=replace(config.optimiser, weight_decay=0.0)), changed=True)
        assert {group["weight_decay"] for group in run.optimiser.param_groups} == {0.0}


def test_what_cannot_be_changed_is_refused_by_name(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(1, size=(40, 48)),))
    train(config)
    longer = replace(config, stages=(Stage(2, size=(40, 48)),))
    for other, name in (
        (replace(longer, optimiser=replace(config.optimiser, kind="muon")), "optimiser.kind"),
        (replace(longer, network=replace(config.network, scales=2)), "network.scales"),
    ):
        with pytest.raises(TrainingError, match=f"another {name}, which --changed cannot change"):
            train(other, changed=True)


def test_the_dropout_may_change_for_it_is_in_no_weight(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(1, size=(40, 48)),))
    train(config)
    longer = replace(config, stages=(Stage(2, size=(40, 48)),), network=replace(config.network, dropout=0.25))
    with pytest.raises(TrainingError, match=r"another network\.dropout"):
        train(longer)
    assert train(longer, changed=True).model.config.dropout == 0.25
    assert load_checkpoint(tmp_path / LAST).config["network"]["dropout"] == 0.25


def test_a_run_keeps_what_it_began_from(tmp_path: Path):
    config = micro(tmp_path / "run", stages=(Stage(1, size=(40, 48)),))
    start = tmp_path / "start.safetensors"
    save_weights(begin(config, World()).model, start)
    train(replace(config, start=start))
    start.unlink()  # it is not read again
    longer = replace(config, stages=(Stage(2, size=(40, 48)),), start=tmp_path / "other.safetensors")
    run = train(longer, changed=True)
    assert (run.config.start, run.config.initialise) == (start, config.initialise)
    assert load_checkpoint(config.out / LAST).config["start"] == str(start)


@pytest.mark.parametrize("stage", [Stage(4, size=(40, 48), clips=2), Stage(4, size=(48, 56), clips=3)])
def test_a_run_goes_on_with_other_clips_from_a_zero_state(tmp_path: Path, stage: Stage):
    config = micro(tmp_path, stages=(Stage(3, size=(40, 48), clips=3),))
    train(config)
    run = train(replace(config, stages=(stage,)), changed=True)
    assert run.update == 4
    assert run.state is not None
    assert run.state.tensors[0].shape[0] == stage.clips


def test_a_file_that_is_no_checkpoint_is_refused(tmp_path: Path):
    (tmp_path / LAST).write_bytes(b"not a checkpoint")
    with pytest.raises(TrainingError, match="not a checkpoint"):
        train(micro(tmp_path))


def test_the_log_tells_training_and_validation(tmp_path: Path):
    told = []
    config = micro(
        tmp_path,
        stages=(Stage(4, size=(40, 48)),),
        validation=ValidationConfig(every=2, clips=1, windows=3, size=(40, 48), score_every=2),
    )
    run = train(config, report=lambda kind, update, numbers: told.append((kind, update)))
    lines = read_log(tmp_path)
    assert [(line["kind"], line["update"]) for line in lines[1:]] == told
    assert told == [("validation", 0), ("train", 2), ("validation", 2), ("train", 4), ("validation", 4)]
    scores = [line for line in lines if line["kind"] == "validation"]
    assert set(scores[0]["lpips"]) == {"as_is", "without_context", "mean_context", "uniform_attention"}
    assert run.best == min(line["lpips"]["as_is"] for line in scores)
    assert set(scores[0]["health"]["live_units"]) == {"upsampler0", "upsampler1", "upsampler2"}
    assert (tmp_path / "preview_0000004.png").exists()


def test_exported_weights_are_the_running_mean(tmp_path: Path):
    config = micro(tmp_path, stages=(Stage(2, size=(40, 48)),), validation=ValidationConfig(0, recordings=(tmp_path,)))
    run = train(config)
    model, card = exported(tmp_path)
    assert (card["updates"], card["best_validation_lpips"]) == (2, None)  # it was never validated
    assert str(tmp_path) not in json.dumps(card)
    assert "/" not in json.dumps(card["recipe"])
    save_weights(model, tmp_path / "out.safetensors", card)
    loaded = load_weights(tmp_path / "out.safetensors")
    for name, value in loaded.state_dict().items():
        torch.testing.assert_close(value, run.averaged.weights[name], atol=1e-3, rtol=1e-3)


def test_the_first_updates_change_every_weight(tmp_path: Path):
    config = micro(tmp_path)
    before = {name: value.clone() for name, value in begin(config, World()).model.state_dict().items()}
    after = train(config).model.state_dict()
    unchanged = [name for name in before if torch.equal(before[name], after[name])]
    assert unchanged == []


def test_learning_rates_follow_their_schedules():
    cosine = OptimiserConfig(learning_rate=1.0, warm_up=10, final_share=0.1)
    assert [learning_rate_at(cosine, update, 110) for update in (0, 9, 10, 60, 110)] == pytest.approx(
        [0.1, 1.0, 1.0, 0.55, 0.1]
    )
    trapezoid = replace(cosine, schedule="trapezoid", cool_down=20)
    assert [learning_rate_at(trapezoid, update, 110) for update in (50, 90, 100, 110)] == pytest.approx(
        [1.0, 1.0, 0.55, 0.1]
    )
    paper = OptimiserConfig(learning_rate=2e-4, warm_up=0, schedule="exponential", decay=0.99, decay_updates=140)
    assert learning_rate_at(paper, 280, 10**6) == pytest.approx(2e-4 * 0.99**2)


def test_auto_precision_is_the_faster_one_and_stays_when_a_run_is_taken_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    config = micro(tmp_path / "run", precision="auto", stages=(Stage(2, size=(40, 48)),))
    monkeypatch.setattr(loop, "bf16_is_worth_trying", lambda: True)
    monkeypatch.setattr(loop, "trial_seconds", lambda config: {"fp32": 1.0, "bf16": 2.0}[config.precision])
    assert loop.train(config).config.precision == "fp32"
    monkeypatch.setattr(loop, "trial_seconds", lambda config: {"fp32": 2.0, "bf16": 1.0}[config.precision])
    last = config.out / "last.pt"
    assert loop.decided(config, World(), last).precision == "fp32"
    assert loop.decided(config, World(), tmp_path / "none").precision == "bf16"
    assert loop.decided(config, World(size=2), tmp_path / "none").precision == "fp32"
    assert loop.train(config).update == 2


def test_a_trial_update_is_timed_and_leaves_nothing_behind(tmp_path: Path):
    config = micro(tmp_path / "run")
    assert loop.trial_seconds(config, updates=1) > 0
    assert not config.out.exists()


def test_a_run_on_gamma_coded_clips_logs_scores_by_density(tmp_path: Path):
    validation = ValidationConfig(every=2, clips=1, windows=2, size=(40, 48), other_densities=(1.0,))
    data = DataConfig(windows=4, workers=0, gamma_share=1.0, density=(0.1, 2.0))
    config = micro(
        tmp_path / "run",
        validation=validation,
        data=data,
        loss=LossConfig(num_scored=1, context=1.0),
        stages=(Stage(2, size=(40, 48)),),
    )
    loop.train(config)
    lines = [line for line in read_log(config.out) if line["kind"] == "validation"]
    assert [set(line["affine_by_density"]) for line in lines] == [{"linear 1", "gamma 1"}] * 2
