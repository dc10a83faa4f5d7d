"""Where a pixel comes from, stage by stage: what it loses when a part of each stage is ablated, measured."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from etnet.events.events import Events
from etnet.inspection.anatomy import anatomy_of
from etnet.inspection.pyramid import give_up_if
from etnet.nets.base import Pyramid, State
from etnet.nets.intervention import Intervention
from etnet.nets.runtime import device_of
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events
from etnet.voxel import normalise_nonzero, voxel_grid

Stage = Literal["events", "bins", "memory", "scales", "skips"]
"""In the order of the data: this window's events, the voxel grid's bins, the state before the step of each recurrent
level, what TPA aggregates, the skips to the upsampler."""
STAGES: tuple[Stage, ...] = ("events", "bins", "memory", "scales", "skips")


@dataclass(frozen=True, slots=True)
class Source:
    """One part of one stage, ablated alone."""

    stage: Stage
    name: str
    at_pixel: float
    """The pixel without the part − with it. Its size is the width of the part's line."""
    mean_absolute: float
    """The same for the image: mean |difference|."""


@dataclass(frozen=True, slots=True)
class Sources:
    """What was measured so far. Parts are ablated one at a time: two that can stand in for each other look small."""

    index: int
    pixel: tuple[int, int]
    value: float
    """The pixel with everything, raw."""
    num_parts: int
    """How many are measured in all."""
    parts: tuple[Source, ...] = ()

    @property
    def is_whole(self) -> bool:
        """Whether every part was measured."""
        return len(self.parts) == self.num_parts

    def of(self, stage: Stage) -> tuple[Source, ...]:
        """The parts of one stage; empty where the network has no such stage."""
        return tuple(part for part in self.parts if part.stage == stage)


@dataclass(frozen=True, slots=True, eq=False)
class _Cut:
    """One ablation: another voxel grid, or another intervention, or both as they were."""

    stage: Stage
    name: str
    voxel: Float[Tensor, "bins h w"] | None = None
    intervention: Intervention | None = None


def pixel_sources(
    playback: Playback, index: int, pixel: tuple[int, int], cancelled: Callable[[], bool] | None = None
) -> Iterator[Sources]:
    """Measure every part of window `index`, one step each (encode and decode); the figure so far after each.

    Events and bins are taken out of the raw votes of this window; the state before the window is held as it is, so
    that what earlier windows gave counts under "memory".
    """
    give_up_if(cancelled, "this figure")
    x, y = pixel
    model, base = playback.model, playback.intervention_at(index)
    before = playback.state(index - 1, cancelled) if index > playback.first else None
    raw = window_events(playback.recording, playback.windows[index], playback.edit_at(index))
    plain = _frame(playback, voxel_grid(raw, model.bins), before, base)
    cuts = _cuts(playback, raw, base)
    found = Sources(index, pixel, float(plain[y, x]), len(cuts))
    for cut in cuts:
        give_up_if(cancelled, "this figure")
        voxel = voxel_grid(raw, model.bins) if cut.voxel is None else cut.voxel
        apart = _frame(playback, voxel, before, cut.intervention or base) - plain
        part = Source(cut.stage, cut.name, float(apart[y, x]), float(apart.abs().mean()))
        found = replace(found, parts=(*found.parts, part))
        yield found


def _cuts(playback: Playback, events: Events, base: Intervention) -> list[_Cut]:
    """The ablations that fit the network, stage by stage."""
    bins = playback.model.bins
    cuts = [
        _Cut("events", name, voxel_grid(_silenced(events, gone), bins))
        for name, gone in (("all events", (1, -1)), ("ON events", (1,)), ("OFF events", (-1,)))
    ]
    for place in range(bins):
        voxel = voxel_grid(events, bins).clone()
        voxel[place] = 0
        cuts.append(_Cut("bins", f"bin {place}", voxel))
    parts = anatomy_of(playback.model)

    def cut(stage: Stage, name: str, **change: object) -> None:
        cuts.append(_Cut(stage, name, intervention=replace(base, **change)))  # pyright: ignore[reportArgumentType]

    for level in parts.levels:
        cut("memory", f"level {level}", zeroed_levels=base.zeroed_levels | {level})
    if parts.scales:
        cut("scales", "TPA", without_context=True)
    if len(parts.scales) > 1:
        for scale in parts.scales:
            cut("scales", f"scale {scale}", removed_scales=base.removed_scales | {scale})
    for level in parts.skips:
        cut("skips", f"skip {level}", removed_skips=base.removed_skips | {level})
    return cuts


def _silenced(events: Events, polarities: tuple[int, ...]) -> Events:
    """The events with some polarities' votes at 0: stamps stay, so that the others keep their bins."""
    p = np.where(np.isin(events.p, polarities), 0, events.p).astype(np.int8)
    return Events(events.x, events.y, events.t, p, events.sensor)


@torch.inference_mode()
def _frame(
    playback: Playback, voxel: Float[Tensor, "bins h w"], before: State | None, intervention: Intervention
) -> Float[Tensor, "h w"]:
    """One whole step from raw votes."""
    model = playback.model
    ready = normalise_nonzero(voxel) if model.normalise_voxels else voxel
    pyramid: Pyramid
    pyramid, _ = model.encode(ready[None].to(device_of(model)), before, intervention)
    return model.decode(pyramid, None, intervention)[0][0, 0].cpu()
