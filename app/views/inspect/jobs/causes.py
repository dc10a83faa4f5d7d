"""What a pixel rests on, what a change does from there on, and how sure a frame is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.jobs.arrays import array
from app.views.inspect.results import CauseFound, OwnSpread, SpreadFound, TwinFound

if TYPE_CHECKING:
    from torch import Tensor

    from etnet.inspection.sources import Sources
    from etnet.playback.playback import Playback

TWIN_WINDOWS = 20
"""Windows from the change's beginning on through which both runs are followed."""
DROP, SEEDS, BACK = 0.2, 5, 4
"""Of the spread: the share of events left out, the draws, and the windows from which on they are left out."""
FURTHEST = 64
"""Windows that a causal search goes back at most."""


@dataclass(frozen=True, slots=True)
class SourcesJob:
    """Every part of every stage ablated alone, for one pixel: one step each."""

    request: FrameRequest
    pixel: tuple[int, int]

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Sources, float]]:
        """One part more each time."""
        from etnet.inspection.sources import pixel_sources

        for figure in pixel_sources(loaded.playback, self.request.index, self.pixel, cancelled):
            yield figure, len(figure.parts) / figure.num_parts


@dataclass(frozen=True, slots=True)
class CauseJob:
    """The window that a pixel rests on, by bisection over resets of the state."""

    request: FrameRequest
    pixel: tuple[int, int]
    tolerance: float
    level: int | None = None
    """Whose state is zeroed; `None`: that of all."""
    towards: float | Literal["camera"] | None = None
    """The value that the pixel should have, or the camera's at that moment; `None`: any change counts."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[CauseFound, float]]:
        """One trial more each time."""
        from etnet.inspection.causal_search import search_cause

        wanted = 2 + int(np.ceil(np.log2(FURTHEST)))
        playback, index = loaded.playback, self.request.index
        towards = self._towards(playback)
        levels = None if self.level is None else frozenset({self.level})
        for search in search_cause(playback, index, self.pixel, levels, self.tolerance, towards, FURTHEST, cancelled):
            yield CauseFound(search, towards), min(len(search.trials) / wanted, 0.99)

    def _towards(self, playback: Playback) -> float | None:
        from etnet.errors import ModelError
        from etnet.inspection.uncertainty import camera_frame

        if self.towards != "camera":
            return self.towards
        seen = camera_frame(playback, self.request.index)
        x, y = self.pixel
        if seen is None or y >= seen.shape[0] or x >= seen.shape[1]:
            raise ModelError("no camera frame at this moment, so what the pixel should be is not known; choose a value")
        return float(seen[y, x])


@dataclass(frozen=True, slots=True)
class TwinJob:
    """The run as it is and the changed one in step, from the change's beginning on."""

    request: FrameRequest
    """Its index is the first window; the change holds from there on, or there alone."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[TwinFound, float]]:
        """One window more each time: two steps."""
        first = self.request.index
        indices = range(first, min(first + TWIN_WINDOWS, len(loaded.playback)))
        pairs: list[tuple[np.ndarray, np.ndarray]] = []
        for index in indices:
            asked = replace(self.request, index=index)
            playback, intervention = loaded.playing(asked)
            changed = playback.at(index, intervention=intervention, cancelled=cancelled).frame
            original = loaded.playback.at(index, cancelled=cancelled).frame
            pairs.append((array(original[0, 0]), array(changed[0, 0])))
            done = indices[: len(pairs)]
            stamps = tuple(loaded.playback.windows[each].t_stop for each in done)
            originals, others = zip(*pairs, strict=True)
            yield TwinFound(tuple(done), stamps, originals, others), len(pairs) / len(indices)


@dataclass(frozen=True, slots=True)
class SpreadJob:
    """Frames with a share of the recent events left out at random: their spread, and whether it tells the error."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[SpreadFound, float]]:
        """One draw more each time; the correlation at last."""
        from etnet.inspection.uncertainty import camera_error, correlation, dropout_spread, own_deviation

        playback, index = loaded.playback, self.request.index
        found, own = None, own_deviation(playback, index, cancelled)
        said = None if own is None else OwnSpread(array(own), None, None)
        for found in dropout_spread(playback, index, DROP, SEEDS, BACK, cancelled=cancelled):
            done = len(found.frames)
            made = SpreadFound(array(found.deviation), done, SEEDS, found.since, own=said)
            yield made, done / (SEEDS + 1)
        assert found is not None
        error = camera_error(playback, index, found.exact)

        def told(map_: Tensor) -> tuple[float | None, float | None]:
            both = None if error is None else correlation(map_, error)
            return (None, None) if both is None else (both.pearson, both.spearman)

        said = None if own is None else OwnSpread(array(own), *told(own))
        yield SpreadFound(array(found.deviation), SEEDS, SEEDS, found.since, *told(found.deviation), said), 1.0
