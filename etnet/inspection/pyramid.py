"""One moment's pyramid, and its frame under a change of the decode: what inspectors that decode often start from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.errors import Cancelled
from etnet.nets.base import Pyramid, Reconstructor, State
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.runtime import device_of
from etnet.playback.playback import Playback


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """A moment that is decoded again and again. Frames made from it are those of `Playback.at`, to the bit, and none
    is kept in the playback's cache.
    """

    model: Reconstructor
    index: int
    pyramid: Pyramid
    state: State

    def frame(self, intervention: Intervention = ORIGINAL) -> Float[Tensor, "h w"]:
        """One decode."""
        with torch.inference_mode():
            return self.model.decode(self.pyramid, None, intervention)[0][0, 0]


def hold(playback: Playback, index: int, cancelled: Callable[[], bool] | None = None) -> Held:
    """Replay up to window `index` and keep what is decoded from."""
    state = playback.state(index, cancelled)
    with torch.inference_mode():
        voxel = playback.voxel(index)[None].to(device_of(playback.model))
        return Held(playback.model, index, playback.model.pyramid(voxel, state), state)


def give_up_if(cancelled: Callable[[], bool] | None, what: str) -> None:
    """Raise `Cancelled` once nobody wants `what` ("this atlas") any more."""
    if cancelled is not None and cancelled():
        raise Cancelled(f"{what} is no longer wanted")
