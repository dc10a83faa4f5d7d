"""Live events → frames, one after the other, as they come."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import torch

from etnet.live.binning import Downsample, binned
from etnet.live.windows import LiveWindows
from etnet.nets.base import Reconstructor, Step
from etnet.nets.runtime import device_of
from etnet.reconstruction import window_voxel
from etnet.windows import Window


@dataclass(frozen=True, slots=True, eq=False)
class LiveStep:
    """One frame. `behind` is how many seconds after its window's last event it was there; `None`: not known."""

    window: Window
    step: Step
    num_merged: int
    behind: float | None


def reconstruct_live(
    model: Reconstructor,
    windows: LiveWindows,
    downsample: Downsample = 1,
    is_stopped: Callable[[], bool] = lambda: False,
    waiting: Callable[[], None] = lambda: None,
) -> Iterator[LiveStep]:
    """A frame for each window, from a cold start, until the source is over or `is_stopped`.

    `waiting` is called twice a second while no window is full.
    """
    state, live = None, windows.live
    while not is_stopped():
        window = windows.take(is_stopped=is_stopped)
        if window is None:
            if live.is_over:
                return
            waiting()
            continue
        voxel = window_voxel(model, binned(live.recording(), downsample), window)[None].to(device_of(model))
        with torch.inference_mode():
            step = model(voxel, state)
        state = step.state
        yield LiveStep(window, step, windows.kept.num_merged(window.index), live.behind(window.t_stop))
