"""The training loop: update after update; now and then log, validate and save."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from etnet.nets.etnet import ETNet
from etnet.nets.precision import bf16_is_worth_trying
from etnet.training.checkpoint import BEST, LAST, check_finite, load_checkpoint, save_checkpoint
from etnet.training.config import TrainConfig, TrainingError
from etnet.training.data import Stretch, stretches
from etnet.training.devices import ahead, decided_device, finish, numbers_of
from etnet.training.distributed import World
from etnet.training.films import Film
from etnet.training.log import RunLog
from etnet.training.other_scenes import affine_by_film, other_films
from etnet.training.run import Run, begin, resume
from etnet.training.validate import films_of, validate

Report = Callable[[str, int, dict[str, Any]], None]
"""Told the kind of a log line ("train", "validation"), the update and the numbers."""


def train(
    config: TrainConfig,
    world: World | None = None,
    report: Report | None = None,
    changed: bool = False,
    clock: Callable[[], float] = time.monotonic,
) -> Run:
    """Train to the end of the config's stages or minutes, taking up the run in `config.out` where there is one.

    `changed` allows the run to go on under another config than it began with. `clock` gives seconds.
    """
    world, began = world or World(), clock()
    torch.set_num_threads(config.threads)
    last = config.out / LAST
    config = decided(replace(config, device=decided_device(config.device)), world, last)
    if config.precision == "bf16" and not _has_fast_bf16(config):
        raise TrainingError("precision is bf16, but this machine multiplies bf16 slower than fp32; train with fp32")
    run = resume(config, world, last, changed) if last.exists() else begin(config, world)
    coming = stretches(config, run.update, [world.lanes(stage.clips) for stage in config.stages])
    if run.device.type != "cpu":
        coming = ahead(coming, Stretch.pinned)  # workers start while the clips of validation are made
    with closing(coming):
        journal = Journal(run, report) if world.leads else None
        for stretch in coming:
            run.step(stretch)
            is_over = config.minutes is not None and world.any_says(clock() - began >= 60 * config.minutes, run.device)
            is_last = is_over or run.update == config.updates
            if is_over:  # before validation, during which a lent machine may go
                _save(run, last)
            if journal is not None:
                journal.after_update(is_last)
            else:
                run.recent.clear()  # nobody reads them here
            if run.update % config.checkpoint_every == 0 or is_last:
                _save(run, last)
            if is_last:
                break
    return run


def _save(run: Run, last: Path) -> None:
    checkpoint = run.checkpoint()
    check_finite(checkpoint)  # in every process: all hold the same weights, and none waits for another then
    if run.world.leads:
        save_checkpoint(checkpoint, last)
    run.world.wait()


def decided(config: TrainConfig, world: World, last: Path) -> TrainConfig:
    """The config with "auto" precision decided: as the run to be taken up has it, else by a trial update of each."""
    if config.precision != "auto":
        return config
    if last.exists():
        kept = load_checkpoint(last).config["precision"]
        return replace(config, precision="bf16" if kept == "bf16" else "fp32")
    if world.size > 1 or not _has_fast_bf16(config):  # several processes might decide differently
        return replace(config, precision="fp32")
    fp32, bf16 = (replace(config, precision=precision) for precision in ("fp32", "bf16"))
    return bf16 if trial_seconds(bf16) < trial_seconds(fp32) else fp32


def _has_fast_bf16(config: TrainConfig) -> bool:
    if config.device == "cuda":
        return torch.cuda.is_bf16_supported(including_emulation=False)
    return bf16_is_worth_trying()


def trial_seconds(config: TrainConfig, updates: int = 2) -> float:
    """Seconds of the fastest of a few updates on empty clips, in a run that is thrown away."""
    stage, length = config.stages[config.stage_at(0)[0]], config.truncate
    run = begin(replace(config, start=None), World())
    shape = (length, stage.clips)
    stretch = Stretch(
        voxels=torch.zeros(*shape, config.network.bins, *stage.size),
        frames=torch.full((*shape, 1, *stage.size), 0.5),
        flow=torch.zeros(*shape, 2, *stage.size),
        is_cold=torch.ones(stage.clips, dtype=torch.bool),
        first_window=(0,) * stage.clips,
        is_gamma=(False,) * stage.clips,
    )
    seconds = []
    for _ in range(min(updates, config.updates)):
        finish(run.device)
        start = time.perf_counter()
        run.step(stretch)
        finish(run.device)
        seconds.append(time.perf_counter() - start)
    return min(seconds)


class Journal:
    """What the leading process writes down: means since the last line, validation, the best weights."""

    def __init__(self, run: Run, report: Report | None) -> None:
        self._run = run
        self._report = report
        other = other_films(run.config) if run.config.validation.every else []
        self._films: list[Film] = [film.to(run.device) for film in films_of(run.config)]
        self._other: list[Film] = [film.to(run.device) for film in other]
        self._log = RunLog(run.config.out, run.update)
        if run.update == 0:
            started = {"start": run.started} if run.started else {}
            self._log.write("config", 0, {"config": run.config.as_plain(), **started})
            self._validate()
        self._clock = time.perf_counter()

    def after_update(self, is_last: bool) -> None:
        """Log, validate and keep the best, when it is time to."""
        run, config = self._run, self._run.config
        if run.update % config.log_every == 0 or is_last:
            self._tell("train", self._means())
        every = config.validation.every
        if every and (run.update % every == 0 or is_last):
            began = time.perf_counter()
            self._validate()
            self._clock += time.perf_counter() - began

    def _means(self) -> dict[str, Any]:
        recent, now = numbers_of(self._run.recent), time.perf_counter()
        means = {name: float(np.mean([line[name] for line in recent])) for name in recent[0]}
        means["seconds_per_update"] = (now - self._clock) / len(recent)
        self._run.recent.clear()
        self._clock = now
        return means

    def _validate(self) -> None:
        run = self._run
        if not self._films:
            return
        averaged = run.averaged.model(run.model)
        assert isinstance(averaged, ETNet)
        scores = validate(averaged, self._films, run.config.validation.score_every, run.lpips)
        every = run.config.validation.score_every
        other = {"affine_by_density": affine_by_film(averaged, self._other, every, run.lpips)} if self._other else {}
        self._tell("validation", {**scores.numbers(), **other})
        self._log.preview(run.update, scores.previews, scores.targets)
        if scores.lpips["as_is"] < run.best:
            run.best = scores.lpips["as_is"]
            save_checkpoint(run.weights_only(), run.config.out / BEST)

    def _tell(self, kind: str, numbers: dict[str, Any]) -> None:
        self._log.write(kind, self._run.update, numbers)
        if self._report is not None:
            self._report(kind, self._run.update, numbers)
