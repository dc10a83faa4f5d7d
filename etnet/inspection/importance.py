"""Does TPA matter here: what the frame loses when a part is taken away, as maps and numbers of the whole frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.nets.base import Reconstructor
from etnet.nets.e2vid import E2VID
from etnet.nets.etnet import ETNet
from etnet.nets.intervention import Intervention
from etnet.playback.playback import Playback


@dataclass(frozen=True, slots=True)
class Ablation:
    """One part taken away for one decode. The memory is left as it is."""

    name: str
    intervention: Intervention


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """What an ablation did to one frame."""

    ablation: Ablation
    frame: Float[Tensor, "h w"]
    """The frame without the part, raw."""
    difference: Float[Tensor, "h w"]
    """Without − with: negative where the part makes the picture brighter."""

    @property
    def mean_absolute(self) -> float:
        """Mean of |difference|."""
        return float(self.difference.abs().mean())

    @property
    def mse(self) -> float:
        """Mean of difference²."""
        return float(self.difference.square().mean())

    def at(self, x: int, y: int) -> float:
        """The difference at one pixel."""
        return float(self.difference[y, x])


def ablations(model: Reconstructor) -> tuple[Ablation, ...]:
    """The parts of `model` that can be taken away, coarse before fine; only skips for a network without TPA.

    A network of another make has none: the answer is empty.
    """
    parts: list[Ablation] = []
    if isinstance(model, ETNet):
        parts += [
            Ablation("TPA", Intervention(without_context=True)),
            Ablation("attention made uniform", Intervention(uniform_attention=True)),
        ]
        if model.config.decoder_depth:
            parts.append(Ablation("decoders", Intervention(without_decoders=True)))
        scales = model.config.scale_indices
        if len(scales) > 1:  # taking the only scale away is taking TPA away
            parts += [Ablation(f"scale {scale}", Intervention(removed_scales=frozenset({scale}))) for scale in scales]
    if isinstance(model, ETNet | E2VID):
        levels = sorted(model.config.skip_levels, reverse=True)
        parts += [Ablation(f"skip {level}", Intervention(removed_skips=frozenset({level}))) for level in levels]
    return tuple(parts)


def effects(
    playback: Playback,
    index: int,
    parts: Sequence[Ablation] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[Effect]:
    """The effect of each ablation on the frame of window `index`, one decode each; all that fit the model by default.

    On a branch an ablation of the decode stands in place of the branch's own change to it.
    """
    original = playback.at(index, cancelled=cancelled).frame[0, 0]
    for part in ablations(playback.model) if parts is None else parts:
        frame = playback.at(index, intervention=part.intervention, cancelled=cancelled).frame[0, 0]
        yield Effect(part, frame, torch.sub(frame, original))
