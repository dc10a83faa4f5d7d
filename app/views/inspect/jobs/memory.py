"""What the network is given, and what it remembers."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.engine.playbacks import LoadedPlayback
from app.engine.requests import FrameRequest
from app.views.inspect.jobs.arrays import array
from app.views.inspect.results import Channels, Given, Norms, Remembered

if TYPE_CHECKING:
    from torch import Tensor


DEPTHS = (0, 1, 2, 4, 8, 16)
"""Windows of memory that are tried."""
TOLERANCE = 0.02
"""Of the raw frame (0 … 1): as near as this is near enough."""
SHOWN_CHANNELS = 24
LOOKED_BACK = 48
"""Windows over which norms are drawn."""


@dataclass(frozen=True, slots=True)
class NetworkInputJob:
    """The exact input of the network, as it is changed."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Given, float]]:
        """One voxel grid."""
        from etnet.inspection.input import network_input, token_map

        playback, _ = loaded.playing(self.request)
        given = network_input(playback, self.request.index)
        height, width = given.voxel.shape[-2:]
        tokens = token_map(playback.model, height, width)
        seen = None if tokens.seen is None else tokens.seen.numpy()
        is_normalised = bool(playback.model.normalise_voxels)
        top, left = given.grid.top, given.grid.left
        below, right = given.padded.shape[1] - height - top, given.padded.shape[2] - width - left
        borders = (top, below, left, right)
        yield Given(array(given.padded), borders, given.limit, is_normalised, seen, tokens.seen_source), 1.0


@dataclass(frozen=True, slots=True)
class ChannelsJob:
    """One plane of one ConvLSTM level, its channels by energy."""

    request: FrameRequest
    level: int
    plane: str

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Channels, float]]:
        """One step's gates, recomputed."""
        from etnet.inspection.gates import channel_energy, gates_at

        playback, _ = loaded.playing(self.request)
        plane: Tensor = getattr(gates_at(playback, self.request.index, self.level, cancelled), self.plane).float()
        energy = channel_energy(plane)
        order = energy.argsort(descending=True)
        shown = order[:SHOWN_CHANNELS]
        yield (
            Channels(
                self.level,
                self.plane,
                shown.cpu().numpy(),
                array(plane[shown]),
                array(energy[shown]),
                len(plane),
            ),
            1.0,
        )


@dataclass(frozen=True, slots=True)
class NormsJob:
    """The norms of every level over the last windows; nothing is decoded."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Norms, float]]:
        """One state more each time."""
        import torch

        from etnet.inspection.through_time import norms_through_time

        playback, _ = loaded.playing(self.request)
        last = self.request.index
        indices = range(max(playback.first, last - LOOKED_BACK + 1), last + 1)
        playback.lay_state(indices[0], cancelled)
        found = []
        for done in norms_through_time(playback, indices):
            found.append(done)
            hidden = torch.stack([norms.hidden for _, norms in found])
            cell = torch.stack([norms.cell for _, norms in found])
            yield Norms(tuple(index for index, _ in found), array(hidden), array(cell)), len(found) / len(indices)


@dataclass(frozen=True, slots=True)
class MemoryDepthJob:
    """The memory of each pixel, measured by cold starts."""

    request: FrameRequest

    def run(self, loaded: LoadedPlayback, cancelled: Callable[[], bool]) -> Iterator[tuple[Remembered, float]]:
        """One depth more each time; deeper ones can only raise what a pixel needs."""
        import torch

        from etnet.inspection.gates import MemoryDepth, memory_depth

        depths = tuple(depth for depth in DEPTHS if depth <= self.request.index - loaded.playback.first) or (0,)
        frames: list[Tensor] = []
        for done, depth in enumerate(depths, start=1):
            one = memory_depth(loaded.playback, self.request.index, (depth,), cancelled)
            frames.append(one.frames[0])
            found = MemoryDepth(depths[:done], torch.stack(frames), one.exact)
            apart = tuple(float(each) for each in found.differences.abs().mean((1, 2)))
            yield Remembered(found.depths, found.needed(TOLERANCE).cpu().numpy(), apart, TOLERANCE), done / len(depths)
