"""Looking inside one moment: what matters in it, what a change does to it, what made it, what it was given."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from app.present.found import (
    Anatomy,
    Attended,
    Channels,
    Given,
    Outcome,
    PartEffect,
    Remembered,
    Traced,
    TracedWindow,
)
from app.studies import Study
from app.studio import Stage
from app.view_state import ViewState
from app.wishes import Wish

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.evaluation.lpips import LPIPS

Cancelled = Callable[[], bool]
DEPTHS = (0, 1, 2, 4, 8, 16)
"""Windows of memory that are tried."""
TOLERANCE = 0.02
"""Of the raw frame (0 … 1): as near as this is near enough."""
SHOWN_CHANNELS = 24


@dataclass(frozen=True, slots=True)
class AnatomyStudy:
    """What the network has."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Anatomy, float]]:
        """One look at the network itself."""
        yield anatomy(stage.playback.model), 1.0


@dataclass(frozen=True, slots=True)
class MattersStudy:
    """The frame without each part in turn: one decode each."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[tuple[PartEffect, ...], float]]:
        """The parts so far."""
        from etnet.inspection.importance import ablations, effects

        playback, index = stage.playback, self.wish.index
        parts = ablations(playback.model)
        found: list[PartEffect] = []
        for effect in effects(playback, index, parts, cancelled):
            found.append(PartEffect(effect.ablation.name, _array(effect.difference)))
            yield tuple(found), len(found) / len(parts)


@dataclass(frozen=True, slots=True)
class AttendedStudy:
    """Where attention goes: q, k and v of all sites, and which tokens nearly every query looks at."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Attended, float]]:
        """Attention first; then sinks, site by site."""
        from etnet.inspection.mass import received
        from etnet.nets.attention import AttentionProbe

        attention = stage.playback.at(self.wish.index, AttentionProbe(values=True), cancelled=cancelled).attention
        if attention is None or not attention.sites:
            return
        sinks: dict[str, np.ndarray] = {}
        for site in attention.sites:
            yield Attended(attention, dict(sinks), attention.nbytes), (len(sinks) + 1) / (len(attention.sites) + 2)
            sinks[site] = received(attention, site).sinks().cpu().numpy()
        yield Attended(attention, sinks, attention.nbytes), 1.0


@dataclass(frozen=True, slots=True)
class OutcomeStudy:
    """The changed frame of `wish` against the original."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Outcome, float]]:
        """Both frames, then how far they lie apart."""
        index = self.wish.index
        playback, intervention = stage.playing(self.wish)
        changed = playback.at(index, intervention=intervention, cancelled=cancelled).frame
        original = stage.playback.at(index, cancelled=cancelled).frame
        mse = float((changed - original).square().mean())
        pair = (_array(original[0, 0]), _array(changed[0, 0]))
        yield Outcome(*pair, mse, None), 0.9
        yield Outcome(*pair, mse, perceptual(changed, original)), 1.0


@dataclass(frozen=True, slots=True)
class TracedStudy:
    """Which events made a pixel: its gradient back through `num_back` windows."""

    wish: Wish
    pixel: tuple[int, int]
    num_back: int

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Traced, float]]:
        """One pass back."""
        from etnet.inspection.attribution import attribute

        playback = stage.playback
        found = attribute(playback, self.wish.index, self.pixel, self.num_back, cancelled)
        windows = [playback.windows[window.index] for window in found.windows]
        traced = tuple(
            TracedWindow(share.index, share.events, share.weights, window.t_start, window.t_stop)
            for share, window in zip(found.windows, windows, strict=True)
        )
        yield Traced(found.pixel, found.value, traced), 1.0


@dataclass(frozen=True, slots=True)
class GivenStudy:
    """The exact input of the network, as it is changed."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Given, float]]:
        """One voxel grid."""
        from etnet.inspection.input import network_input, token_map

        playback, _ = stage.playing(self.wish)
        given = network_input(playback, self.wish.index)
        height, width = given.voxel.shape[-2:]
        tokens = token_map(playback.model, height, width)
        seen = None if tokens.seen is None else tokens.seen.numpy()
        is_normalised = bool(playback.model.normalise_voxels)
        top, left = given.grid.top, given.grid.left
        below, right = given.padded.shape[1] - height - top, given.padded.shape[2] - width - left
        borders = (top, below, left, right)
        yield Given(_array(given.padded), borders, given.limit, is_normalised, seen, tokens.seen_source), 1.0


@dataclass(frozen=True, slots=True)
class ChannelsStudy:
    """One plane of one ConvLSTM level, its channels by energy."""

    wish: Wish
    level: int
    plane: str

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Channels, float]]:
        """One step's gates, recomputed."""
        from etnet.inspection.gates import channel_energy, gates_at

        playback, _ = stage.playing(self.wish)
        plane: Tensor = getattr(gates_at(playback, self.wish.index, self.level, cancelled), self.plane).float()
        energy = channel_energy(plane)
        order = energy.argsort(descending=True)
        shown = order[:SHOWN_CHANNELS]
        yield (
            Channels(
                self.level,
                self.plane,
                shown.cpu().numpy(),
                _array(plane[shown]),
                _array(energy[shown]),
                len(plane),
            ),
            1.0,
        )


@dataclass(frozen=True, slots=True)
class RememberedStudy:
    """The memory of each pixel, measured by cold starts."""

    wish: Wish

    def run(self, stage: Stage, cancelled: Cancelled) -> Iterator[tuple[Remembered, float]]:
        """One depth more each time; deeper ones can only raise what a pixel needs."""
        import torch

        from etnet.inspection.gates import MemoryDepth, memory_depth

        depths = tuple(depth for depth in DEPTHS if depth <= self.wish.index) or (0,)
        frames: list[Tensor] = []
        for done, depth in enumerate(depths, start=1):
            one = memory_depth(stage.playback, self.wish.index, (depth,), cancelled)
            frames.append(one.frames[0])
            found = MemoryDepth(depths[:done], torch.stack(frames), one.exact)
            apart = tuple(float(each) for each in found.differences.abs().mean((1, 2)))
            yield Remembered(found.depths, found.needed(TOLERANCE).cpu().numpy(), apart, TOLERANCE), done / len(depths)


def ask_inside(state: ViewState, wish: Wish) -> Mapping[str, Study]:
    """What the inspector that is open wants to know of the moment; nothing while all are closed."""
    inside, query = state.inside, state.query
    plain, asked = wish.plain, replace(wish, wants_attention=False)
    if inside.opened == "none":
        return {}
    wanted: dict[str, Study] = {"inside.anatomy": AnatomyStudy(replace(plain, index=0))}
    match inside.opened:
        case "matters":
            wanted["inside.matters"] = MattersStudy(plain)
            if query is not None:
                wanted["inside.attended"] = AttendedStudy(plain)
        case "change" if not wish.is_original:
            wanted["inside.outcome"] = OutcomeStudy(asked)
        case "events" if query is not None:
            wanted["inside.traced"] = TracedStudy(plain, query, inside.num_back)
        case "input":
            wanted["inside.given"] = GivenStudy(asked)
        case "state":
            wanted["inside.channels"] = ChannelsStudy(asked, inside.level, inside.plane)
        case "memory":
            wanted["inside.remembered"] = RememberedStudy(plain)
        case _:
            pass
    return wanted


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
    import torch

    from etnet.evaluation.lpips import MIN_SIDE

    if min(changed.shape[-2:]) < MIN_SIDE:
        return None
    with torch.inference_mode():
        return float(_lpips()(changed.float().cpu().clamp(0, 1), original.float().cpu().clamp(0, 1)))


@cache
def _lpips() -> LPIPS:
    from etnet.evaluation.lpips import load_lpips

    return load_lpips()


def _sorted(levels: frozenset[int]) -> tuple[int, ...]:
    return tuple(sorted(levels, reverse=True))


def _array(tensor: Tensor) -> np.ndarray:
    array = tensor.detach().float().cpu().numpy()
    array.flags.writeable = False
    return array
