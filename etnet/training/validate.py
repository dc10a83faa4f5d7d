"""Fixed clips that no training saw, scored as the network is, without its context and with uniform attention."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from etnet.evaluation.lpips import LPIPS
from etnet.nets.attention import Attention, AttentionProbe
from etnet.nets.base import Pyramid, State
from etnet.nets.etnet import ETNet
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.simulation.sequence import simulate_sequence
from etnet.training.config import TrainConfig
from etnet.training.data import draw_pictures, sequence_config
from etnet.training.films import Film
from etnet.training.watch import Health, health_of
from etnet.voxel import voxel_grid
from etnet.windows import BetweenFrames, plan_windows

CONDITIONS: dict[str, tuple[Intervention, bool]] = {
    "as_is": (ORIGINAL, False),
    "without_context": (Intervention(without_context=True), False),
    "mean_context": (ORIGINAL, True),
    "uniform_attention": (Intervention(uniform_attention=True), False),
}
"""What tells whether TPA, and its attention, are of any use: an intervention, and whether TPA's output is everywhere
its mean over the image. Zeroing TPA costs much where it is but a constant that the upsampler counts on; its mean does
not."""


@dataclass(frozen=True, eq=False)
class Scores:
    """LPIPS by condition (a mean over films), L1 and MSE of the network as it is, and each film's LPIPS."""

    lpips: dict[str, float]
    l1: float
    mse: float
    films: dict[str, float]
    grey: float
    """LPIPS of a constant grey at each frame's own mean."""
    health: Health
    previews: Float[Tensor, "b 1 h w"]
    targets: Float[Tensor, "b 1 h w"]
    """The last scored frame of each simulated film, and the truth."""

    def numbers(self) -> dict[str, object]:
        """For the log."""
        return {
            "lpips": self.lpips,
            "l1": self.l1,
            "mse": self.mse,
            "films": self.films,
            "lpips_grey": self.grey,
            "health": self.health.numbers(),
        }


def films_of(config: TrainConfig) -> list[Film]:
    """What a run is validated on, the same at every update and for every run with the same validation config."""
    if not config.validation.every:
        return []
    return simulated_films(config) + [recorded_film(path, config) for path in config.validation.recordings]


def simulated_films(config: TrainConfig) -> list[Film]:
    """Clips of held-out pictures at sensor size."""
    validation = config.validation
    if not validation.clips:
        return []
    pictures = draw_pictures(config.data, "held-out", validation.seed)
    films = []
    for index in range(validation.clips):
        rng = np.random.default_rng([validation.seed, index])
        sequence = simulate_sequence(pictures, sequence_config(config, validation.size), rng)
        voxels, frames = sequence.voxels[: validation.windows], sequence.frames[: validation.windows]
        films.append(Film(f"clip{index}", torch.from_numpy(voxels), torch.from_numpy(frames).unsqueeze(1)))
    return films


def recorded_film(path: Path, config: TrainConfig) -> Film:
    """The first windows between the frames of a real recording."""
    # Where a run is trained away from home (`pack.py`), the readers' packages need not be there.
    from etnet.events.open import open_recording

    recording = open_recording(path)
    try:
        windows = list(plan_windows(recording, BetweenFrames()))[: config.validation.windows]
        truth = recording.ground_truth
        assert truth is not None
        voxels = [voxel_grid(recording.read(window.start, window.stop), config.network.bins) for window in windows]
        frames = [torch.from_numpy(truth.read_frame(window.index + 1)).unsqueeze(0) for window in windows]
        return Film(path.stem, torch.stack(voxels), torch.stack(frames))
    finally:
        recording.source.close()


@torch.no_grad()
def validate(model: ETNet, films: Sequence[Film], score_every: int, lpips: LPIPS) -> Scores:
    """Run every film from a cold start and score each `score_every`-th frame under every condition."""
    was_training = model.training
    model.eval()
    by_film: dict[str, dict[str, list[float]]] = {}
    greys, l1, mse, healths, previews = [], [], [], [], []
    for film in films:
        scores: dict[str, list[float]] = {name: [] for name in CONDITIONS}
        state: State | None = None
        last = len(film.voxels) - 1 - (len(film.voxels) - 1) % score_every
        for index, voxel in enumerate(film.voxels):
            pyramid, state = model.encode(voxel.unsqueeze(0), state)
            if index % score_every:
                continue
            target = film.frames[index : index + 1]
            truth = lpips.features(target)
            for name, (intervention, is_averaged) in CONDITIONS.items():
                with _averaged_context(model) if is_averaged else nullcontext():
                    frame, _ = model.decode(pyramid, intervention=intervention)
                scores[name].append(float(lpips.distance(lpips.features(frame.clamp(0, 1)), truth)))
                if name == "as_is":
                    l1.append(float((frame - target).abs().mean()))
                    mse.append(float(((frame - target) ** 2).mean()))
            greys.append(float(lpips.distance(lpips.features(target.mean().expand_as(target)), truth)))
            if index == last:
                previews.append((model.decode(pyramid)[0], target))
                healths.append(_health(model, pyramid))
        by_film[film.name] = scores
    model.train(was_training)
    means = {name: float(np.mean([np.mean(scores[name]) for scores in by_film.values()])) for name in CONDITIONS}
    return Scores(
        lpips=means,
        l1=float(np.mean(l1)),
        mse=float(np.mean(mse)),
        films={name: float(np.mean(scores["as_is"])) for name, scores in by_film.items()},
        grey=float(np.mean(greys)),
        health=Health.mean(healths),
        previews=torch.cat([frame for frame, _ in previews if frame.shape == previews[0][0].shape]),
        targets=torch.cat([target for _, target in previews if target.shape == previews[0][1].shape]),
    )


@contextmanager
def _averaged_context(model: ETNet) -> Iterator[None]:
    handle = model.tpa.register_forward_hook(
        lambda module, inputs, output: output.mean((2, 3), keepdim=True).expand_as(output)
    )
    try:
        yield
    finally:
        handle.remove()


def _health(model: ETNet, pyramid: Pyramid) -> Health:
    attention: Attention | None
    with health_of(model) as watch:
        _, attention = model.decode(pyramid, AttentionProbe())
    assert attention is not None
    return watch.health(pyramid, attention)
