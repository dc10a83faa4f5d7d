"""What one pixel owes to events, and to other places through attention, now and over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.looking.arrays import array
from app.present.found import Followed, RolledOut, Traced, TracedWindow
from app.studio import Stage
from app.wishes import Wish
from etnet.errors import ModelError

if TYPE_CHECKING:
    from etnet.nets.attention import Attention


FOLLOWED = 24
"""Windows through which a pixel's attention is followed."""
NEAR = 16
"""Pixels to each side of the pixel that count as near it."""


@dataclass(frozen=True, slots=True)
class TracedStudy:
    """Which events made a pixel: its gradient back through `num_back` windows."""

    wish: Wish
    pixel: tuple[int, int]
    num_back: int

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[Traced, float]]:
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
class RolledOutStudy:
    """Attention rolled out through all of TPA, from the pixel's token back to what enters."""

    wish: Wish
    pixel: tuple[int, int]
    discard: float

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[RolledOut, float]]:
        """One decode that is watched, and about as much again."""
        from etnet.inspection.rollout import rollout

        attention = _watched(stage, self.wish, cancelled)
        found = rollout(attention, attention.grid.token_at(*self.pixel), self.discard, cancelled=cancelled)
        yield RolledOut(found.scales, array(found.weights), self.discard), 1.0


@dataclass(frozen=True, slots=True)
class FollowedStudy:
    """The pixel's attention at one site over the last windows: one decode each."""

    wish: Wish
    pixel: tuple[int, int]
    site: str

    def run(self, stage: Stage, cancelled: Callable[[], bool]) -> Iterator[tuple[Followed, float]]:
        """One window more each time. Nothing of it is lost when others are served between two of them."""
        from etnet.inspection.mass import Region, region_shares
        from etnet.inspection.through_time import Track, attention_through_time
        from etnet.nets.padding import TokenGrid

        playback, last = stage.playback, self.wish.index
        sensor = playback.recording.sensor
        grid = TokenGrid(sensor.height, sensor.width)
        x, y = self.pixel
        region = Region(x - NEAR, y - NEAR, x + NEAR + 1, y + NEAR + 1)
        even = float(region_shares(grid, region).mean())
        indices = range(max(0, last - FOLLOWED + 1), last + 1)
        playback.lay_state(indices[0], cancelled)
        moments = []
        for index in indices:
            moments += attention_through_time(playback, self.pixel, [index], frozenset({self.site}), region)
            track = Track.of(moments)
            followed = Followed(
                tuple(track.index.tolist()),
                tuple(track.t.tolist()),
                array(track.along_row[:, 0].mean(1) * grid.num_tokens),
                array(track.entropy[:, 0].mean(1)),
                array(track.mass[:, 0].mean(1)),
                even,
                grid.num_tokens,
                NEAR,
            )
            yield followed, len(moments) / len(indices)


def _watched(stage: Stage, wish: Wish, cancelled: Callable[[], bool]) -> Attention:
    """q and k of all sites, of the network as it is changed."""
    from etnet.nets.attention import AttentionProbe

    playback, intervention = stage.playing(wish)
    attention = playback.at(wish.index, AttentionProbe(), intervention, cancelled).attention
    if attention is None or not attention.sites:
        raise ModelError(f"{playback.model.name} has no attention to roll out")
    return attention
