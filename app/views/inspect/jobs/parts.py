"""What the parts of a network are worth: what it has, what is lost without each, what a change does."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.jobs.arrays import array
from app.views.inspect.results import AblatedParts, Attended, Outcome, PartEffect
from etnet.events.edit import UNEDITED, EventEdit
from etnet.nets.intervention import ORIGINAL, Intervention

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.inspection.anatomy import Anatomy


@dataclass(frozen=True, slots=True)
class AblatedPartsJob:
    """The frame without TPA, each skip, this window's events, and the state before. Answers for every pixel."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[AblatedParts, float]]:
        """One part more each time: a decode, or a step."""
        from etnet.inspection.anatomy import anatomy_of
        from etnet.inspection.pyramid import give_up_if

        playback, index = loaded.playback, self.request.index
        original = playback.at(index, cancelled=cancelled).frame
        parts = anatomy_of(playback.model)
        cuts = _cuts(parts)
        found: dict[str, np.ndarray] = {}
        for name, intervention, edit in cuts:
            give_up_if(cancelled, "this ablation")
            if intervention.changes_memory or not edit.changes_nothing:
                frame = playback.branch(index, intervention, edit).at(index, cancelled=cancelled).frame
            else:
                frame = playback.at(index, intervention=intervention, cancelled=cancelled).frame
            found[name] = array((frame - original)[0, 0])
            yield AblatedParts(dict(found), parts.levels), len(found) / len(cuts)


def _cuts(parts: Anatomy) -> list[tuple[str, Intervention, EventEdit]]:
    cuts = [("TPA", Intervention(without_context=True), UNEDITED)] if parts.scales else []
    cuts += [
        (f"skip {level}", Intervention(removed_skips=frozenset({level})), UNEDITED) for level in sorted(parts.skips)
    ]
    cuts.append(("events now", ORIGINAL, EventEdit(drop=1.0)))
    if parts.levels:
        cuts.append(("state before", Intervention(zeroed_levels=frozenset(parts.levels)), UNEDITED))
    return cuts


@dataclass(frozen=True, slots=True)
class ImportanceJob:
    """The frame without each part in turn: one decode each."""

    request: FrameRequest

    def run(
        self, loaded: LoadedPlayback, cancelled: Callable[[], bool]
    ) -> Iterator[tuple[tuple[PartEffect, ...], float]]:
        """The parts so far."""
        from etnet.inspection.anatomy import require
        from etnet.inspection.importance import ablations, effects

        require(loaded.playback.model, "ablation")
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


def perceptual(changed: Tensor, original: Tensor) -> float | None:
    """LPIPS of two raw frames, clipped to 0 … 1; `None` where they are too small for it."""
    from etnet.evaluation.lpips import perceptual_distance

    return perceptual_distance(changed.float().cpu().clamp(0, 1), original.float().cpu().clamp(0, 1))
