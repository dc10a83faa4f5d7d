"""What each head does to the frame when it is masked, and whether attention matters at all here."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest

if TYPE_CHECKING:
    from etnet.inspection.atlas import Atlas
    from etnet.inspection.importance import Ablation

HELD_BYTES = 96 << 20
"""Of atlases that were begun; the newest is held in any case."""


class BegunAtlases:
    """Atlases by job, whole or left before, so that they go on where they were. Used by the engine's thread alone."""

    def __init__(self) -> None:
        self._held: OrderedDict[AtlasJob, Atlas] = OrderedDict()

    def find(self, job: AtlasJob) -> Atlas | None:
        """What was measured before, if it is still held."""
        return self._held.get(job)

    def keep(self, job: AtlasJob, atlas: Atlas) -> None:
        """Hold what is measured; the oldest go."""
        self._held[job] = atlas
        self._held.move_to_end(job)
        while len(self._held) > 1 and sum(held.nbytes for held in self._held.values()) > HELD_BYTES:
            self._held.popitem(last=False)


BEGUN = BegunAtlases()


@dataclass(frozen=True, slots=True)
class AtlasJob:
    """Every head masked in turn, one decode each. Of the original network: a change does not move the bars."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Atlas, float]]:
        """One head more each time. It gives way before a decode, and loses nothing by that."""
        from etnet.inspection.atlas import head_atlas

        held = BEGUN.find(self)
        for atlas in head_atlas(loaded.playback, self.request.index, held, cancelled):
            done, wanted = atlas.progress
            BEGUN.keep(self, atlas)
            yield atlas, (done + 1) / (wanted + 1)


@dataclass(frozen=True, slots=True, eq=False)
class PartEffects:
    """Frames without a part − the frame, by the part's name."""

    differences: dict[str, Float32[np.ndarray, "h w"]]

    def at(self, name: str, pixel: tuple[int, int]) -> float | None:
        """What a part moves the pixel by; `None` while it is not measured."""
        found = self.differences.get(name)
        return None if found is None else float(found[pixel[1], pixel[0]])

    def on_image(self, name: str) -> float | None:
        """Mean |difference| over the frame."""
        found = self.differences.get(name)
        return None if found is None else float(np.abs(found).mean())


@dataclass(frozen=True, slots=True)
class MattersJob:
    """The frame with all attention made uniform, and without TPA; with a site, without that site's attention."""

    request: FrameRequest
    site: str | None = None

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[PartEffects, float]]:
        """One decode each."""
        from etnet.inspection.anatomy import require
        from etnet.inspection.importance import effects

        anatomy = require(loaded.playback.model, "attention")
        parts = self._parts(None if self.site is None else anatomy.site(self.site))
        found: dict[str, np.ndarray] = {}
        for effect in effects(loaded.playback, self.request.index, parts, cancelled):
            found[effect.ablation.name] = effect.difference.float().cpu().numpy()
            yield PartEffects(dict(found)), len(found) / len(parts)

    def _parts(self, site: str | None) -> list[Ablation]:
        from etnet.inspection.importance import Ablation
        from etnet.nets.intervention import Intervention

        if site is not None:
            return [Ablation("site", Intervention(removed_sites=frozenset({site})))]
        return [
            Ablation("uniform", Intervention(uniform_attention=True)),
            Ablation("TPA", Intervention(without_context=True)),
        ]
