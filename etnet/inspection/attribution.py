"""Which events made this pixel: the gradient of a pixel back to every event's vote, and occlusion as its slow twin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from etnet.errors import Cancelled, ModelError
from etnet.events.events import Events
from etnet.inspection.anatomy import require
from etnet.nets.base import State
from etnet.nets.runtime import device_of
from etnet.playback.playback import Playback
from etnet.reconstruction import window_events
from etnet.voxel import MIN_EVENTS, bin_votes, normalise_nonzero, voxel_grid


@dataclass(frozen=True, slots=True, eq=False)
class WindowShare:
    """What one window's events did to the pixel, to first order."""

    index: int
    events: Events
    """As the network saw them (after an edit)."""
    weights: Float32[np.ndarray, " n"]
    """Each event's vote times the gradient there: how much the pixel owes it. Their sum is gradient · voxel."""
    gradient: Float[Tensor, "bins h w"]
    """∂pixel / ∂voxel, before normalisation."""


@dataclass(frozen=True, slots=True, eq=False)
class Attribution:
    """The events of some windows and what one pixel owes them; `windows` from the earliest to the shown one."""

    pixel: tuple[int, int]
    value: float
    """The pixel, raw."""
    windows: tuple[WindowShare, ...]

    @property
    def by_window(self) -> Float32[np.ndarray, " windows"]:
        """Σ |weight| of each window: how far back the pixel owes anything."""
        return np.array([np.abs(window.weights).sum() for window in self.windows], np.float32)


def attribute(
    playback: Playback,
    index: int,
    pixel: tuple[int, int],
    num_back: int = 2,
    cancelled: Callable[[], bool] | None = None,
) -> Attribution:
    """Trace pixel (x, y) of window `index` to the events of it and of the `num_back` windows before.

    What came before those is taken as given (the state before them is a constant). A gradient says what a small
    change would do, not what the frame would be without the events; `occlude` says that. Holds the activations of
    `num_back` + 1 steps. The network's precision should be fp32.
    """
    require(playback.model, "gradient")
    x, y = _inside(playback, pixel)
    first, state = _start(playback, index, num_back, cancelled)
    taken = {
        i: window_events(playback.recording, playback.windows[i], playback.edit_at(i)) for i in range(first, index + 1)
    }
    with torch.inference_mode(False), torch.enable_grad():
        grids = [voxel_grid(events, playback.model.bins).to(device_of(playback.model)) for events in taken.values()]
        voxels = [grid.requires_grad_() for grid in grids]
        known = None if state is None else state.clone()  # tensors made in inference mode know no gradient
        value = _pixel(playback, first, voxels, known, (x, y), cancelled)
        if not value.requires_grad:
            raise ModelError(
                f"{playback.model.name}: no gradient comes back from its frame, so no pixel can be traced to events; "
                "its step detaches, runs without gradients or leaves torch; use occlude, which needs none"
            )
        # A frozen state cuts the window off from the pixel: its gradient is zero then.
        gradients = torch.autograd.grad(value, voxels, materialize_grads=True)
    windows = [
        WindowShare(i, events, event_weights(events, gradient.cpu()), gradient.cpu())
        for (i, events), gradient in zip(taken.items(), gradients, strict=True)
    ]
    return Attribution((x, y), float(value.detach()), tuple(windows))


def event_weights(events: Events, gradient: Float[Tensor, "bins h w"]) -> Float32[np.ndarray, " n"]:
    """Each event's vote times the gradient where it falls: p [(1 − share) G(lower) + share G(upper)]."""
    if len(events) < MIN_EVENTS:
        return np.zeros(len(events), np.float32)
    votes, slope = bin_votes(events, len(gradient)), gradient.numpy()
    lower = (1 - votes.share) * slope[votes.lower, events.y, events.x]
    upper = votes.share * slope[votes.upper, events.y, events.x]
    return (events.p * (lower + upper)).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class Occlusion:
    """How the pixel changes when the votes in one patch of one window are taken away: with − without."""

    pixel: tuple[int, int]
    value: float
    first_index: int
    patch: int
    """Pixels on a patch's side."""
    change: Float[Tensor, "windows rows columns"]


def occlude(
    playback: Playback,
    index: int,
    pixel: tuple[int, int],
    num_back: int = 0,
    patch: int = 16,
    cancelled: Callable[[], bool] | None = None,
) -> Occlusion:
    """Take away every patch that holds a vote, one at a time, and reconstruct again: one run for each of them."""
    x, y = _inside(playback, pixel)
    first, state = _start(playback, index, num_back, cancelled)
    grids = [
        voxel_grid(window_events(playback.recording, playback.windows[i], playback.edit_at(i)), playback.model.bins)
        for i in range(first, index + 1)
    ]
    voxels = [grid.to(device_of(playback.model)) for grid in grids]
    height, width = voxels[0].shape[-2:]
    change = torch.zeros(len(voxels), -(-height // patch), -(-width // patch))
    with torch.inference_mode():
        value = float(_pixel(playback, first, voxels, state, (x, y), cancelled))
        for window, row, column in np.ndindex(*change.shape):
            place = (..., slice(row * patch, (row + 1) * patch), slice(column * patch, (column + 1) * patch))
            if not voxels[window][place].any():
                continue
            without = voxels[window].clone()
            without[place] = 0
            changed = [*voxels[:window], without, *voxels[window + 1 :]]
            change[window, row, column] = value - float(_pixel(playback, first, changed, state, (x, y), cancelled))
    return Occlusion((x, y), value, first, patch, change)


def _pixel(
    playback: Playback,
    first: int,
    voxels: list[Tensor],
    state: State | None,
    pixel: tuple[int, int],
    cancelled: Callable[[], bool] | None,
) -> Tensor:
    """The pixel that these raw voxel grids lead to from `state`."""
    model, pyramid = playback.model, None
    for i, voxel in enumerate(voxels, start=first):
        if cancelled is not None and cancelled():
            raise Cancelled("this attribution is no longer wanted")
        ready = normalise_nonzero(voxel) if model.normalise_voxels else voxel
        pyramid, state = model.encode(ready[None], state, playback.intervention_at(i))
    assert pyramid is not None
    frame, _ = model.decode(pyramid, None, playback.intervention_at(first + len(voxels) - 1))
    return frame[0, 0, pixel[1], pixel[0]]


def _start(
    playback: Playback, index: int, num_back: int, cancelled: Callable[[], bool] | None
) -> tuple[int, State | None]:
    """The first window to trace and the state before it."""
    if num_back < 0:
        raise ValueError(f"num_back is {num_back}; it is a number of windows, at least 0")
    first = max(playback.first, index - num_back)
    return first, playback.state(first - 1, cancelled) if first > playback.first else None


def _inside(playback: Playback, pixel: tuple[int, int]) -> tuple[int, int]:
    x, y = pixel
    sensor = playback.recording.sensor
    if not (0 <= x < sensor.width and 0 <= y < sensor.height):
        raise ValueError(f"pixel ({x}, {y}) lies outside the sensor of {sensor}")
    return x, y
