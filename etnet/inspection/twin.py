"""What a change does from here on: two playbacks in step, the original and the changed one, and the curve between."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from etnet.events.edit import UNEDITED, EventEdit
from etnet.inspection.pyramid import give_up_if
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.playback.playback import Playback


def changed(
    playback: Playback,
    at: int,
    intervention: Intervention = ORIGINAL,
    edit: EventEdit = UNEDITED,
    once: bool = False,
) -> Playback:
    """The playback in which a change holds from window `at` on, or, `once`, in window `at` alone.

    After a single window everything is as `playback` has it, except what its memory carries on: so it is seen how
    the network recovers.
    """
    branch = playback.branch(at, intervention, edit)
    if not once or at + 1 >= len(playback):
        return branch
    for start in (at + 1, *(start for start in branch_starts(playback) if start > at + 1)):
        branch = branch.branch(start, playback.intervention_at(start), playback.edit_at(start))
    return branch


def branch_starts(playback: Playback) -> tuple[int, ...]:
    """The windows at which the changes of a playback begin, ascending; none for the original."""
    starts = set()
    owner: Playback | None = playback
    while owner is not None and owner.parent is not None:
        starts.add(owner.branch_at)
        owner = owner.parent
    return tuple(sorted(starts))


@dataclass(frozen=True, slots=True, eq=False)
class TwinMoment:
    """One window of both runs."""

    index: int
    t: int
    """The frames' stamp, µs."""
    original: Float[Tensor, "h w"]
    changed: Float[Tensor, "h w"]

    @property
    def difference(self) -> Float[Tensor, "h w"]:
        """Changed − original."""
        return self.changed - self.original


def twin(
    playback: Playback,
    twin_playback: Playback,
    indices: Sequence[int],
    cancelled: Callable[[], bool] | None = None,
) -> Iterator[TwinMoment]:
    """Both runs in step, window by window; each frame is the one that its run gives alone, to the bit."""
    for index in indices:
        give_up_if(cancelled, "this twin")
        original = playback.at(index, cancelled=cancelled).frame[0, 0]
        other = twin_playback.at(index, cancelled=cancelled).frame[0, 0]
        yield TwinMoment(index, playback.windows[index].t_stop, original, other)


@dataclass(frozen=True, slots=True, eq=False)
class EffectCurve:
    """How far the two runs lie apart, window by window."""

    index: Int64[Tensor, " windows"]
    t: Int64[Tensor, " windows"]
    mean_absolute: Float[Tensor, " windows"]
    """Mean |changed − original| over the image."""
    largest: Float[Tensor, " windows"]
    """The largest |changed − original| of a pixel."""
    at_pixel: Float[Tensor, " windows"] | None
    """Changed − original at the pixel; `None` without one."""

    @staticmethod
    def of(moments: Iterable[TwinMoment], pixel: tuple[int, int] | None = None) -> EffectCurve:
        """The curve of some moments, at least one; frames are not kept."""
        index, t, mean, largest, at_pixel = [], [], [], [], []
        for moment in moments:
            apart = moment.difference
            index.append(moment.index)
            t.append(moment.t)
            mean.append(float(apart.abs().mean()))
            largest.append(float(apart.abs().max()))
            at_pixel.append(float(apart[pixel[1], pixel[0]]) if pixel is not None else 0.0)
        if not index:
            raise ValueError("a curve is made of at least one moment; none was given")
        pixel_curve = torch.tensor(at_pixel) if pixel is not None else None
        return EffectCurve(torch.tensor(index), torch.tensor(t), torch.tensor(mean), torch.tensor(largest), pixel_curve)

    def recovered_at(self, tolerance: float = 0.02) -> int | None:
        """The window from which on no pixel is further than `tolerance` off; `None` if that is not reached."""
        off = (self.largest > tolerance).nonzero()[:, 0].tolist()
        first = off[-1] + 1 if off else 0
        return int(self.index[first]) if first < len(self.index) else None
