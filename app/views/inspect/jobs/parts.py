"""What the parts of a network are worth: what it has, what is lost without each, what a change does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.jobs.arrays import array
from app.views.inspect.results import Anatomy, Attended, Outcome, PartEffect

if TYPE_CHECKING:
    from torch import Tensor


@dataclass(frozen=True, slots=True)
class PartsJob:
    """What the network has."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Anatomy, float]]:
        """One look at the network itself."""
        yield anatomy(loaded.playback.model), 1.0


@dataclass(frozen=True, slots=True)
class ImportanceJob:
    """The frame without each part in turn: one decode each."""

    request: FrameRequest

    def run(
        self, loaded: LoadedPlayback, cancelled: Callable[[], bool]
    ) -> Iterator[tuple[tuple[PartEffect, ...], float]]:
        """The parts so far."""
        from etnet.inspection.importance import ablations, effects

        playback, index = loaded.playback, self.request.index
        parts = ablations(playback.model)
        found: list[PartEffect] = []
        for effect in effects(playback, index, parts, cancelled):
            found.append(PartEffect(effect.ablation.name, array(effect.difference)))
            yield tuple(found), len(found) / len(parts)


@dataclass(frozen=True, slots=True)
class AttendedJob:
    """Where attention goes: q, k and v of all sites, and which tokens nearly every query looks at."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Attended, float]]:
        """Attention first; then sinks, site by site."""
        from etnet.inspection.mass import received
        from etnet.nets.attention import AttentionProbe

        attention = loaded.playback.at(self.request.index, AttentionProbe(values=True), cancelled=cancelled).attention
        if attention is None or not attention.sites:
            return
        sinks: dict[str, np.ndarray] = {}
        for site in attention.sites:
            yield Attended(attention, dict(sinks), attention.nbytes), (len(sinks) + 1) / (len(attention.sites) + 2)
            sinks[site] = received(attention, site).sinks().cpu().numpy()
        yield Attended(attention, sinks, attention.nbytes), 1.0


@dataclass(frozen=True, slots=True)
class OutcomeJob:
    """The changed frame of `request` against the original."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Outcome, float]]:
        """Both frames, then how far they lie apart."""
        index = self.request.index
        playback, intervention = loaded.playing(self.request)
        changed = playback.at(index, intervention=intervention, cancelled=cancelled).frame
        original = loaded.playback.at(index, cancelled=cancelled).frame
        mse = float((changed - original).square().mean())
        pair = (array(original[0, 0]), array(changed[0, 0]))
        yield Outcome(*pair, mse, None), 0.9
        yield Outcome(*pair, mse, perceptual(changed, original)), 1.0


def anatomy(model: Any) -> Anatomy:
    """What a network has; of a network of another make only its name is known."""
    from etnet.inspection.gates import recurrent_levels
    from etnet.nets.e2vid import E2VID
    from etnet.nets.etnet import ETNet

    num_levels = len(recurrent_levels(model))
    if isinstance(model, E2VID):
        return Anatomy(model.name, skips=_sorted(model.config.skip_levels), num_levels=num_levels)
    if not isinstance(model, ETNet):
        return Anatomy(str(model.name), num_levels=num_levels)
    config = model.config
    encoders = [f"encoder.{layer}.self" for layer in range(config.encoder_depth)]
    decoders = [f"decoder.{layer}.{kind}" for layer in range(config.decoder_depth) for kind in ("self", "cross")]
    return Anatomy(
        model.name,
        config.scale_indices,
        config.decoder_depth > 0,
        _sorted(config.skip_levels),
        tuple(f"scale{scale}.{place}" for scale in config.scale_indices for place in (*encoders, *decoders)),
        config.heads,
        num_levels,
    )


def perceptual(changed: Tensor, original: Tensor) -> float | None:
    """LPIPS of two raw frames, clipped to 0 … 1; `None` where they are too small for it."""
    from etnet.evaluation.lpips import perceptual_distance

    return perceptual_distance(changed.float().cpu().clamp(0, 1), original.float().cpu().clamp(0, 1))


def _sorted(levels: frozenset[int]) -> tuple[int, ...]:
    return tuple(sorted(levels, reverse=True))
