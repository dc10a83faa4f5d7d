"""One run: what changes from update to update, how an update is made, how a run begins and is taken up again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.optim import Optimizer

from etnet.evaluation.lpips import LPIPS, load_lpips
from etnet.nets.base import State
from etnet.nets.etnet import ETNet
from etnet.nets.padding import PATCH, TokenGrid
from etnet.nets.presets import build_model
from etnet.nets.runtime import Runtime, apply_runtime, device_of
from etnet.nets.weights import load_weights
from etnet.training.checkpoint import (
    Checkpoint,
    RunningMean,
    check_continues,
    check_same_run,
    load_checkpoint,
    validates_alike,
)
from etnet.training.config import OptimiserConfig, TrainConfig, TrainingError
from etnet.training.context_reader import ContextReader, context_of
from etnet.training.data import Stretch
from etnet.training.devices import on_host
from etnet.training.distributed import World
from etnet.training.initialise import DEEP_PATH, start_attention_locally, start_locally, start_upsampler, take_fitting
from etnet.training.losses import Pairs, Terms, drives_of, score, silence, without_tone
from etnet.training.optimiser import build_optimiser
from etnet.training.unroll import Draw, blindfold, draw_update, restart, unroll


def learning_rate_at(config: OptimiserConfig, update: int, updates: int) -> float:
    """The rate of an update (counted from 0): a straight warm-up, then the schedule."""
    if update < config.warm_up:
        return config.learning_rate * (update + 1) / config.warm_up
    if config.schedule == "exponential":
        return config.learning_rate * config.decay ** (update // config.decay_updates)
    if config.schedule == "trapezoid":
        left = min(1.0, (updates - update) / max(1, config.cool_down))
        return config.learning_rate * (config.final_share + (1 - config.final_share) * left)
    progress = (update - config.warm_up) / max(1, updates - config.warm_up)
    share = config.final_share + (1 - config.final_share) * 0.5 * (1 + math.cos(math.pi * min(1.0, progress)))
    return config.learning_rate * share


@dataclass(slots=True)
class Run:
    """A run under way: everything that changes from one update to the next."""

    config: TrainConfig
    world: World
    model: ETNet
    averaged: RunningMean
    optimiser: Optimizer
    lpips: LPIPS
    reader: ContextReader
    started: dict[str, Any] = field(default_factory=dict)
    """Where it began from weights: the network's parameters that stayed "fresh", and the fields in which it "differs"
    from theirs (theirs, its own), of which no shape tells."""
    update: int = 0
    state: State | None = None
    best: float = math.inf
    """Lowest LPIPS on the config's validation; of another one it begins anew."""
    recent: list[dict[str, Tensor | float]] = field(default_factory=list)
    """Of each update since the log's last line; not read before the next one (`devices.numbers_of`)."""

    @property
    def device(self) -> torch.device:
        """Where it computes."""
        return device_of(self.model)

    def step(self, stretch: Stretch) -> Terms:
        """One update. Nothing in it waits for a GPU."""
        config, stretch = self.config, stretch.to(self.device)
        stage, done = config.stage_at(self.update)
        draw = draw_update(config, self.update, self.world.lanes(config.stages[stage].clips))
        before = None if done == 0 else restart(self.state, stretch.is_cold)
        rate = learning_rate_at(config.optimiser, self.update, config.updates)
        for group in self.optimiser.param_groups:
            group["lr"] = rate * group.get("rate_share", 1.0)

        with torch.random.fork_rng(devices=[]):
            # For dropout alone; each process has its own, so with it two processes are not one.
            torch.manual_seed((config.seed * 1_000_003 + self.update) * 1024 + self.world.rank)
            terms, state = self._forward(stretch, before, draw)
        self.optimiser.zero_grad(set_to_none=True)
        terms.total.backward()
        trained = [*self.model.parameters(), *self.reader.parameters()]
        self.world.average_gradients(trained)
        norm = nn.utils.clip_grad_norm_(trained, config.optimiser.clip_norm)
        self.optimiser.step()

        self.update += 1
        self.state = state.detach()
        self.averaged.take(self.model, self.update)
        self.recent.append({**terms.numbers(), "gradient_norm": norm, "learning_rate": rate})
        return terms

    def _forward(self, stretch: Stretch, before: State | None, draw: Draw) -> tuple[Terms, State]:
        pyramid, state = unroll(self.model, stretch.voxels, before, draw.scored)
        if draw.blind is not None:
            pyramid = blindfold(pyramid, draw.blind)
        with context_of(self.model) as contexts, drives_of(self.model) as drives:
            frames, _ = self.model.decode(pyramid, intervention=draw.intervention, placement=draw.placement)
        # A list as an index would be copied to the device, and waited for.
        targets, loss = torch.cat([stretch.frames[window] for window in draw.scored]), self.config.loss
        is_gamma = torch.tensor(stretch.is_gamma * len(draw.scored))
        if any(stretch.is_gamma):
            frames = without_tone(frames, targets, is_gamma.to(self.device, non_blocking=True))
        told = self._told(contexts[0], targets, is_gamma) if loss.context else None
        alive = silence(drives) if loss.alive else None
        return score(frames, targets, loss, self.lpips, self._pairs(stretch, draw), told, alive), state

    def _told(
        self, context: Float[Tensor, "b d i j"], targets: Float[Tensor, "b 1 h w"], is_gamma: Bool[Tensor, " b"]
    ) -> Tensor:
        """What a linear layer reads off TPA's output, against the frames whose tone it can know.

        Where there is no such frame its parameters have gradients all the same: processes average theirs in one
        message, and one that sent fewer would be misunderstood.
        """
        linear = (~is_gamma).nonzero()[:, 0]
        share = self.world.share_of(len(linear), self.device)
        if not len(linear):
            return 0.0 * torch.stack([part.sum() for part in self.reader.parameters()]).sum()
        linear = linear.to(self.device, non_blocking=True)
        return share * self.reader.error(context[linear], targets[linear])

    def _pairs(self, stretch: Stretch, draw: Draw) -> Pairs | None:
        """Scored frames that follow each other directly, from window L0 of their clip on.

        Clips are staggered, so that processes may hold unequally many.
        """
        loss = self.config.loss
        if not loss.temporal or self.update < loss.temporal_after:
            return None
        clips = stretch.voxels.shape[1]
        found = [
            (i * clips + lane, (i + 1) * clips + lane, window + 1, lane)
            for i, window in enumerate(draw.scored[:-1])
            for lane in range(clips)
            if draw.scored[i + 1] == window + 1 and stretch.first_window[lane] + window + 1 >= loss.temporal_from
        ]
        share = self.world.share_of(len(found), self.device)
        if not found:
            return None
        before, after, windows, lanes = (torch.tensor(column) for column in zip(*found, strict=True))
        moved = (there.to(self.device, non_blocking=True) for there in (before, after, stretch.flow[windows, lanes]))
        return Pairs(*moved, share=share)

    def checkpoint(self) -> Checkpoint:
        """This moment. Every process has to ask for it, as each holds its own clips' memory."""
        memory = () if self.state is None else tuple(self.world.gathered(tensor) for tensor in self.state.tensors)
        return replace(self.weights_only(), optimiser=on_host(self.optimiser.state_dict()), memory=on_host(memory))

    def weights_only(self) -> Checkpoint:
        """What is worth keeping of this moment, but not enough to go on from."""
        return Checkpoint(
            update=self.update,
            config=self.config.as_plain(),
            weights=on_host(self.model.state_dict()),
            averaged=on_host(self.averaged.weights),
            reader=on_host(self.reader.state_dict()),
            optimiser={},
            memory=(),
            best=self.best,
        )


def begin(config: TrainConfig, world: World) -> Run:
    """A run at its start."""
    generator = torch.Generator().manual_seed(config.seed)
    model = build_model(config.network, generator)
    started: dict[str, Any] = {}
    if config.start is not None:
        without = DEEP_PATH if config.initialise == "local" else ()
        started = _take_start(model, config.start, without)
    if config.initialise == "local":
        start_locally(model, generator)
    if config.initialise == "local-attention":
        start_attention_locally(model, generator)
    if config.initialise == "upsampler":
        start_upsampler(model.upsampler, generator)
    assert config.precision != "auto", "the loop decides before a run begins"
    assert config.device != "auto", "the loop decides before a run begins"
    # Weights are drawn by the processor, so that a run begins alike on every device.
    device = torch.device(config.device)
    apply_runtime(model.to(device), Runtime(config.precision, config.attention, config.channels_last))
    model.train()
    reader = ContextReader(config.network.dim, generator).to(device)
    optimiser = build_optimiser(model, reader.parameters(), config.optimiser)
    averaged, lpips = RunningMean(model, config.optimiser.ema), load_lpips().to(device)
    return Run(config, world, model, averaged, optimiser, lpips, reader, started)


def _take_start(model: ETNet, path: Path, without: tuple[str, ...]) -> dict[str, Any]:
    """Take what fits of a file's weights; what the log says of it (`Run.started`)."""
    source = load_weights(path)
    fresh = take_fitting(model, source.state_dict(), without)
    # A bias or a norm may fit by chance: the tail's bias is one number in every network.
    if all(name in fresh for name, value in model.state_dict().items() if value.ndim > 1):
        raise TrainingError(
            f"{path}: no layer of this {type(source).__name__} fits the network; choose the --config or --network "
            "options that it was made with, or leave --start out to begin from nothing"
        )
    own = asdict(model.config)
    theirs = {name: getattr(source.config, name, value) for name, value in own.items()}
    others = {name: [theirs[name], value] for name, value in own.items() if theirs[name] != value}
    return {"fresh": fresh, "differs": others}


def resume(config: TrainConfig, world: World, path: Path, changed: bool = False) -> Run:
    """The run that a checkpoint holds, as if it had never stopped. `changed` allows another config from here on.

    What it began from stays what the checkpoint says, whatever the config does.
    """
    checkpoint = load_checkpoint(path)
    if changed:
        check_continues(config, checkpoint, path)
    else:
        check_same_run(config, checkpoint, path)
    run = begin(replace(config, start=None), world)
    run.config = replace(config, **_beginning(checkpoint.config))
    run.model.load_state_dict(checkpoint.weights)
    run.reader.load_state_dict(checkpoint.reader)
    run.averaged.weights = {name: value.to(run.device) for name, value in checkpoint.averaged.items()}
    decays = [group["weight_decay"] for group in run.optimiser.param_groups]
    run.optimiser.load_state_dict(checkpoint.optimiser)
    for group, decay in zip(run.optimiser.param_groups, decays, strict=True):
        group["weight_decay"] = decay  # the config's, which torch replaces by the checkpoint's
    run.update = checkpoint.update
    run.best = checkpoint.best if validates_alike(config, checkpoint) else math.inf
    memory = () if changed and not _is_of_clips(checkpoint.memory, config, run.update) else checkpoint.memory
    lanes = world.lanes(memory[0].shape[0]) if memory else range(0)
    own = tuple(tensor[lanes.start : lanes.stop].clone().to(run.device) for tensor in memory)
    run.state = State(own) if own else None
    return run


def _beginning(plain: Mapping[str, Any]) -> dict[str, Any]:
    start = plain.get("start")
    return {"start": None if start is None else Path(start), "initialise": plain.get("initialise", "default")}


def _is_of_clips(memory: tuple[Tensor, ...], config: TrainConfig, update: int) -> bool:
    """Whether a state is one of the clips, by number and size, that the next update sees."""
    if not memory or update >= config.updates:
        return True
    stage = config.stages[config.stage_at(update)[0]]
    grid, sides = TokenGrid(*stage.size), PATCH // 2  # the first state lies at half the frame's size
    return memory[0].shape[0] == stage.clips and memory[0].shape[-2:] == (sides * grid.rows, sides * grid.columns)
