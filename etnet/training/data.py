"""Endless fresh clips. What an update sees depends on (seed, update) alone, so a run can be taken up anywhere."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Thread

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, Sampler

from etnet.simulation.config import SequenceConfig
from etnet.simulation.pictures import PicturePool
from etnet.simulation.sequence import simulate_sequence
from etnet.training.augment import Clip, augment
from etnet.training.config import DataConfig, TrainConfig

ClipKey = tuple[int, int, int]
"""(stage, lane, number): the number-th clip of one of a stage's parallel clips."""

NICENESS = 19
"""Workers yield to everything else on the machine."""

SPARE_FILES = 200
"""Open files that a run may need beside those of its clips."""

PARENT_LOOK_SECONDS = 1.0
"""How often a worker looks whether its run is still there."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """What one update sees: windows of several clips side by side."""

    voxels: Float[Tensor, "t b bins h w"]
    frames: Float[Tensor, "t b 1 h w"]
    flow: Float[Tensor, "t b 2 h w"]
    is_cold: Bool[Tensor, " b"]
    """Clips that begin here."""
    first_window: tuple[int, ...]
    """Where in its clip each one stands."""
    is_gamma: tuple[bool, ...]
    """Clips whose frames are gamma-coded although the run's target is linear."""

    def pinned(self) -> Stretch:
        """The same in memory from which a GPU copies while others work."""
        return self._with(lambda tensor: tensor.pin_memory())

    def to(self, device: torch.device) -> Stretch:
        """The same where a network is; nothing waits for the copy. Flow stays: an update takes a few of its rows."""
        return self._with(lambda tensor: tensor.to(device, non_blocking=True))

    def _with(self, moved: Callable[[Tensor], Tensor]) -> Stretch:
        return replace(self, voxels=moved(self.voxels), frames=moved(self.frames), is_cold=moved(self.is_cold))


@dataclass(frozen=True, slots=True)
class Slot:
    """What a lane shows at an update: which of its clips, and which window of it comes first."""

    number: int
    first_window: int
    begins: bool


def slot_at(update: int, lane: int, num_lanes: int, chunks: int, truncate: int) -> Slot:
    """Lanes are staggered, so that an update meets beginnings and late windows alike.

    `update` counts from the stage's start, where every lane begins with a (for most lanes shortened) clip.
    """
    phase = update + lane * chunks // num_lanes
    number = phase // chunks
    chunk = phase % chunks if number else update
    return Slot(number, chunk * truncate, begins=update == 0 or chunk == 0)


def draw_pictures(config: DataConfig, split: str, seed: int) -> PicturePool:
    """The pool of a split; without photos, pictures made of noise and shapes."""
    if config.photos is None:
        offset = 0 if split == "train" else 1
        return procedural_pool(np.random.default_rng([seed, 9, offset]))
    return PicturePool.from_folder(config.photos, config.cutouts, "train" if split == "train" else "held-out")


def procedural_pool(rng: np.random.Generator, count: int = 24, size: tuple[int, int] = (160, 200)) -> PicturePool:
    """Pictures without any file: noise of several octaves with discs and bars on it."""
    photos = []
    for _ in range(count):
        picture = np.full(size, rng.uniform(40, 200), np.float32)
        for octave in range(1, 6):
            knots = rng.normal(0, 60 / octave, (3 * octave, 4 * octave)).astype(np.float32)
            picture += cv2.resize(knots, (size[1], size[0]), interpolation=cv2.INTER_CUBIC)
        for _ in range(int(rng.integers(2, 9))):
            centre = (int(rng.integers(size[1])), int(rng.integers(size[0])))
            tone, extent = float(rng.uniform(0, 255)), int(rng.integers(6, 40))
            if rng.random() < 0.5:
                cv2.circle(picture, centre, extent, tone, -1, cv2.LINE_AA)
            else:
                corner = (centre[0] + extent, centre[1] + int(rng.integers(4, 40)))
                cv2.rectangle(picture, centre, corner, tone, -1)
        photos.append(np.clip(picture, 0, 255).astype(np.uint8))
    return PicturePool.of(photos)


class ClipSource(Dataset[Clip]):
    """`source[key]` simulates a clip and augments it; pure in (seed, key). Pictures are decoded where it is used."""

    def __init__(self, config: TrainConfig) -> None:
        self._config = config
        self._pictures: PicturePool | None = None

    def __getitem__(self, key: ClipKey) -> Clip:
        config = self._config
        if self._pictures is None:
            self._pictures = draw_pictures(config.data, "train", config.seed)
        rng = np.random.default_rng([config.seed, 1, *key])
        wanted, is_gamma = drawn_config(
            config, config.stages[key[0]].size, np.random.default_rng([config.seed, 4, *key])
        )
        sequence = simulate_sequence(self._pictures, wanted, rng)
        return augment(Clip(sequence.voxels, sequence.frames, sequence.flow, is_gamma), config.augment, rng)


def drawn_config(config: TrainConfig, size: tuple[int, int], rng: np.random.Generator) -> tuple[SequenceConfig, bool]:
    """The simulator's config for one clip with its density and tone drawn, and whether its frames are gamma-coded."""
    plain, data = sequence_config(config, size), config.data
    if data.density is not None:
        low, high = np.log(data.density)
        aim = float(np.exp(rng.uniform(low, high)))
        plain = replace(plain, scene=replace(plain.scene, density=aim, density_sigma=0.0))
    is_gamma = data.target_tone == "linear" and bool(rng.random() < data.gamma_share)
    return (replace(plain, target_tone="srgb") if is_gamma else plain), is_gamma


def sequence_config(config: TrainConfig, size: tuple[int, int]) -> SequenceConfig:
    """The simulator's config for clips of one size."""
    data = config.data
    return SequenceConfig(
        size=size,
        num_windows=data.windows,
        bins=config.network.bins,
        target_tone=data.target_tone,
        scene=data.scene,
        sensor=data.sensor,
    )


class _Keys(Sampler[ClipKey]):
    def __init__(self, config: TrainConfig, start: int, lanes: Sequence[range]) -> None:
        self._config, self._start, self._lanes = config, start, lanes

    def __iter__(self) -> Iterator[ClipKey]:
        config = self._config
        for update in range(self._start, config.updates):
            stage, _ = config.stage_at(update)
            for lane in self._lanes[stage]:
                slot = slot_of(config, update, lane)
                if slot.begins or update == self._start:
                    yield stage, lane, slot.number


def slot_of(config: TrainConfig, update: int, lane: int) -> Slot:
    """`slot_at` for an update counted from the start of the run."""
    stage, done = config.stage_at(update)
    chunks = config.data.windows // config.truncate
    return slot_at(done, lane, config.stages[stage].clips, chunks, config.truncate)


def stretches(config: TrainConfig, start: int, lanes: Sequence[range]) -> Generator[Stretch]:
    """One `Stretch` an update from update `start` on; `lanes[stage]` are the clips that this process holds."""
    workers = config.data.workers
    shares = workers > 0 and _fits_shared_memory(config)
    loader = DataLoader(
        ClipSource(config),
        batch_size=None,
        sampler=_Keys(config, start, lanes),
        num_workers=workers,
        prefetch_factor=config.data.prefetch if workers else None,
        worker_init_fn=_be_modest,
        collate_fn=_as_tensors if shares else _as_is,  # pyright: ignore[reportArgumentType]  it gets one clip
        # Not "fork": OpenCV's and torch's threads do not survive one.
        multiprocessing_context="spawn" if workers else None,
        # The loader seeds its workers; a generator of its own keeps torch's global one untouched.
        generator=torch.Generator().manual_seed(config.seed),
    )
    clips, held = iter(loader), {}
    for update in range(start, config.updates):
        stage, _ = config.stage_at(update)
        slots = {lane: slot_of(config, update, lane) for lane in lanes[stage]}
        for lane, slot in slots.items():
            if slot.begins or update == start:
                clip = next(clips)
                held[lane] = clip if isinstance(clip, Clip) else _of_tensors(*clip)
        yield _stretch([(held[lane], slot) for lane, slot in slots.items()], config.truncate)


def _stretch(lanes: list[tuple[Clip, Slot]], length: int) -> Stretch:
    def stacked(name: str) -> Tensor:
        parts = [getattr(clip, name)[slot.first_window : slot.first_window + length] for clip, slot in lanes]
        return torch.from_numpy(np.stack(parts, 1))

    return Stretch(
        voxels=stacked("voxels"),
        frames=stacked("frames").unsqueeze(2),
        flow=stacked("flow"),
        is_cold=torch.tensor([slot.first_window == 0 for _, slot in lanes]),
        first_window=tuple(slot.first_window for _, slot in lanes),
        is_gamma=tuple(clip.is_gamma for clip, _ in lanes),
    )


def _as_is(clip: Clip) -> Clip:
    return clip


def _as_tensors(clip: Clip) -> tuple[Tensor, Tensor, Tensor, bool]:
    """torch hands tensors over in shared memory; arrays go through a pipe, at five times the cost for the run's own
    process, which with many workers would do little else."""
    return torch.from_numpy(clip.voxels), torch.from_numpy(clip.frames), torch.from_numpy(clip.flow), clip.is_gamma


def _of_tensors(voxels: Tensor, frames: Tensor, flow: Tensor, is_gamma: bool) -> Clip:
    return Clip(voxels.numpy(), frames.numpy(), flow.numpy(), is_gamma)


def _fits_shared_memory(config: TrainConfig, folder: Path = Path("/dev/shm")) -> bool:
    """Whether all clips that may be on their way fit twice; where they do not, a worker would be ended by a signal."""
    if not folder.is_dir():
        return False
    data = config.data
    num_clips = data.workers * (data.prefetch + 1) + max(stage.clips for stage in config.stages)
    pixels = max(stage.size[0] * stage.size[1] for stage in config.stages)
    num_bytes = 4 * num_clips * data.windows * pixels * (config.network.bins + 3)
    num_files = 3 * num_clips + SPARE_FILES
    return 2 * num_bytes <= shutil.disk_usage(folder).free and num_files <= os.sysconf("SC_OPEN_MAX")


def _be_modest(worker: int) -> None:
    """A worker has one thread and the lowest priority."""
    cv2.setNumThreads(1)
    torch.set_num_threads(1)
    with suppress(OSError):
        os.nice(NICENESS)
    Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    # A killed run takes no clips any more, and a worker that has some to hand over would wait for ever.
    while os.getppid() == parent:
        time.sleep(PARENT_LOOK_SECONDS)
    os._exit(1)
