"""What one pixel owes to events, and to other places through attention, now and over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.jobs.arrays import array
from app.views.inspect.results import Followed, RolledOut, Traced, TracedWindow
from app.views.inspect.state import Fusion
from app.views.stretch import NEAR, path_of, windows_from

if TYPE_CHECKING:
    from etnet.nets.attention import Attention


@dataclass(frozen=True, slots=True)
class AttributionJob:
    """Which events made a pixel: its gradient back through `num_back` windows."""

    request: FrameRequest
    pixel: tuple[int, int]
    num_back: int

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Traced, float]]:
        """One pass back."""
        from etnet.inspection.attribution import attribute

        playback = loaded.playback
        found = attribute(playback, self.request.index, self.pixel, self.num_back, cancelled)
        windows = [playback.windows[window.index] for window in found.windows]
        traced = tuple(
            TracedWindow(share.index, share.events, share.weights, window.t_start, window.t_stop)
            for share, window in zip(found.windows, windows, strict=True)
        )
        yield Traced(found.pixel, found.value, traced), 1.0


@dataclass(frozen=True, slots=True)
class RolloutJob:
    """Attention rolled out through all of TPA, from the pixel's token back to what enters."""

    request: FrameRequest
    pixel: tuple[int, int]
    discard: float
    fusion: Fusion = "mean"

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[RolledOut, float]]:
        """One decode that is watched, and about as much again."""
        from etnet.inspection.rollout import rollout

        attention = _watched(loaded, self.request, cancelled)
        token = attention.grid.token_at(*self.pixel)
        found = rollout(attention, token, self.discard, fusion=self.fusion, cancelled=cancelled)
        yield RolledOut(found.scales, array(found.weights), self.discard), 1.0


@dataclass(frozen=True, slots=True)
class ThroughTimeJob:
    """The pixel's attention at one site, of one head or of the mean map, past and coming: one decode a window."""

    request: FrameRequest
    """Its index is the stretch's first window."""
    pixel: tuple[int, int]
    site: str
    head: int | None = None
    anchor: int | None = None
    """The window in which the patch that is followed lies at the pixel; `None`: none is followed."""

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Followed, float]]:
        """One window more each time. Nothing of it is lost when others are served between two of them."""
        from etnet.inspection.anatomy import require
        from etnet.inspection.mass import Region, region_shares
        from etnet.inspection.through_time import Track, attention_through_time
        from etnet.nets.padding import TokenGrid

        playback = loaded.playback
        anatomy = require(playback.model, "attention")
        site, chosen = anatomy.site(self.site), anatomy.head(self.head)
        sensor = playback.recording.sensor
        grid = TokenGrid(sensor.height, sensor.width)
        path = path_of(playback, windows_from(playback, self.request.index), self.pixel, self.anchor, cancelled)
        indices = sorted(path)
        even = float(region_shares(grid, Region.around(self.pixel, NEAR)).mean())
        playback.lay_state(indices[0], cancelled)
        moments = []
        head = "mean" if chosen is None else chosen
        for index in indices:
            sites = frozenset({site})
            moments += attention_through_time(playback, path, [index], sites, None, cancelled, head, NEAR)
            track = Track.of(moments)
            followed = Followed(
                tuple(track.index.tolist()),
                tuple(track.t.tolist()),
                array(track.along_row[:, 0, 0] * grid.num_tokens),
                array(track.entropy[:, 0, 0]),
                array(track.mass[:, 0, 0]),
                even,
                grid.num_tokens,
                NEAR,
            )
            yield followed, len(moments) / len(indices)


def _watched(loaded: LoadedPlayback, request: FrameRequest, cancelled: Callable[[], bool]) -> Attention:
    """q and k of all sites, of the network as it is changed."""
    from etnet.inspection.anatomy import require
    from etnet.nets.attention import AttentionProbe

    playback, intervention = loaded.playing(request)
    require(playback.model, "rollout")
    attention = playback.at(request.index, AttentionProbe(), intervention, cancelled).attention
    assert attention is not None
    return attention
