"""The verb of this library: a recording and a model → frames, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.events.edit import UNEDITED, EventEdit
from etnet.events.events import Events
from etnet.events.recording import Recording
from etnet.nets.base import Reconstructor, Step
from etnet.voxel import normalise_nonzero, voxel_grid
from etnet.windows import Policy, Window, plan_windows


def window_voxel(
    model: Reconstructor, recording: Recording, window: Window, edit: EventEdit = UNEDITED
) -> Float[Tensor, "bins h w"]:
    """The exact tensor that `model` gets for one window: voted, and normalised if the model declares it."""
    voxel = voxel_grid(window_events(recording, window, edit), model.bins)
    return normalise_nonzero(voxel) if model.normalise_voxels else voxel


def window_events(recording: Recording, window: Window, edit: EventEdit = UNEDITED) -> Events:
    """The events of one window, after an edit."""
    return edit.applied(recording.read(window.start, window.stop), window.start)


def reconstruct(
    model: Reconstructor, recording: Recording, windows: Policy | Sequence[Window]
) -> Iterator[tuple[Window, Step]]:
    """Every window of `recording` in order, from a cold start, with the step that `model` makes of it.

    `windows`: the policy that plans them, or windows that were cut before.
    """
    state = None
    for window in windows if isinstance(windows, Sequence) else plan_windows(recording, windows):
        voxel = window_voxel(model, recording, window)[None]
        with torch.inference_mode():
            step = model(voxel, state)
        state = step.state
        yield window, step
