"""Playback: any frame, in any order, equal to the sequential run bit for bit (law 2)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from etnet.byte_cache import ByteCache
from etnet.errors import Cancelled, WindowError
from etnet.events.edit import UNEDITED, EventEdit
from etnet.events.recording import Recording
from etnet.nets.attention import AttentionProbe
from etnet.nets.base import Pyramid, Reconstructor, State, Step, variance_of
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.runtime import contract_of, device_of
from etnet.nets.storage import kept_alive
from etnet.playback.checkpoints import Checkpoints
from etnet.playback.disk_cache import DiskCache, RunCache
from etnet.playback.run_key import run_cache
from etnet.reconstruction import window_voxel
from etnet.windows import Window

STATE_SHARE = 0.85
"""Of the byte budget, for states; the rest holds frames."""


@dataclass(frozen=True, slots=True)
class Seek:
    """What it takes to show one window: replay `num_replayed` windows after state `from_index` (−1: a cold start)."""

    index: int
    from_index: int
    num_replayed: int
    has_frame: bool


@dataclass(frozen=True, slots=True)
class CacheReport:
    """Which frames and states are held, as half-open ranges of window indices, and their bytes."""

    frames: tuple[range, ...]
    states: tuple[range, ...]
    nbytes: int


class Playback:
    """Exact random access to what `model` makes of `windows`.

    A frame comes from the frame cache; else from the state after its window, decoded with no replay; else from the
    nearest state before it, replaying `encode` alone, and one `decode`. Used by one thread at a time. States before
    an intervention's start are shared with the branch (`branch`). With `disk`, what an earlier run under the same
    contract has kept counts as held, and what this one makes is kept for later ones.
    """

    def __init__(
        self,
        model: Reconstructor,
        recording: Recording,
        windows: Sequence[Window],
        budget_bytes: int = 512 << 20,
        disk: DiskCache | None = None,
        first: int = 0,
    ) -> None:
        """`first`: the window that is reached from a cold start; those before it cannot be asked for."""
        self.model = model
        self.recording = recording
        self.windows = windows
        self.first = first
        self.intervention = ORIGINAL
        self.edit = UNEDITED
        self.branch_at = 0
        self.parent: Playback | None = None
        self._budget_bytes = budget_bytes
        self._states = Checkpoints(int(budget_bytes * STATE_SHARE))
        share = budget_bytes - int(budget_bytes * STATE_SHARE)
        self._frames: ByteCache[tuple[int, Intervention], Tensor] = ByteCache(share, overhead=0)
        self._playhead = 0
        self._disk = None if disk is None else run_cache(disk, model, recording, windows)
        self._contract = contract_of(model)

    def __len__(self) -> int:
        return len(self.windows)

    def grow(self, recording: Recording, windows: Sequence[Window]) -> None:
        """The recording is longer by now: `windows` are those from before, which are what they were, and more."""
        if len(windows) > len(self.windows):
            self._disk = None
            self.recording, self.windows = recording, windows

    def at(
        self,
        index: int,
        probe: AttentionProbe | None = None,
        intervention: Intervention = ORIGINAL,
        cancelled: Callable[[], bool] | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Step:
        """The step of window `index`, exactly as the sequential run gives it.

        `intervention` here changes this one decode; one that is carried in the memory needs `branch`. `cancelled`
        is asked between steps and ends the work with `Cancelled`, keeping the states that were made; `progress`
        is told (windows replayed, windows to replay).
        """
        self._check(index)
        self._playhead = index
        frame = self.frame(index, intervention) if probe is None else None
        state = self._state(index)
        if frame is not None and state is not None:
            return Step(frame, state, variance=variance_of(self.model, state))
        with torch.inference_mode():
            pyramid, state = self._pyramid(index, cancelled, progress)
            if frame is not None:
                return Step(frame, state, variance=variance_of(self.model, state))
            frame, attention = self.model.decode(pyramid, probe, self._decoding(intervention, index))
        self._keep_frame((index, intervention), frame)
        if intervention == ORIGINAL and (disk := self._usable_disk()) is not None:
            disk.put_frame(index, frame)
        return Step(frame, state, attention, variance_of(self.model, state))

    def frame(self, index: int, intervention: Intervention = ORIGINAL) -> Float[Tensor, "1 1 h w"] | None:
        """The frame of window `index` if it is held, here or on disk, else `None`; computes nothing."""
        frame = self._frames.find((index, intervention))
        if frame is None and intervention == ORIGINAL and (disk := self._usable_disk()) is not None:
            frame = disk.frame(index)
            if frame is not None:
                frame = frame.to(device_of(self.model))
                self._keep_frame((index, intervention), frame)
        return frame

    def lay_state(self, index: int, cancelled: Callable[[], bool] | None = None) -> None:
        """Make sure that the state after window `index` was computed, decoding nothing (prefetch)."""
        self.state(index, cancelled)

    def state(self, index: int, cancelled: Callable[[], bool] | None = None) -> State:
        """The state after window `index`, decoding nothing."""
        self._check(index)
        held = self._state(index)
        if held is not None:
            return held
        with torch.inference_mode():
            return self._pyramid(index, cancelled, None)[1]

    def approximate(
        self,
        index: int,
        warm_up: int,
        cancelled: Callable[[], bool] | None = None,
        probe: AttentionProbe | None = None,
        first: int | None = None,
    ) -> Step:
        """The frame after a cold start `warm_up` windows earlier: a preview, never kept, never called exact.

        It begins with window `first` at the earliest, which may lie before this playback's own.
        """
        first = self.first if first is None else first
        self._check(index, first)
        state, pyramid = None, None
        with torch.inference_mode():
            for i in range(max(first, index - warm_up), index + 1):
                _raise_if(cancelled)
                pyramid, state = self.model.encode(self._input(i), state, self.intervention_at(i))
            assert pyramid is not None
            assert state is not None
            frame, attention = self.model.decode(pyramid, probe, self._decoding(ORIGINAL, index))
        return Step(frame, state, attention, variance=variance_of(self.model, state))

    def voxel(self, index: int) -> Float[Tensor, "bins h w"]:
        """The voxel grid that the network gets for window `index`, its normalisation applied."""
        self._check(index, first=0)
        return window_voxel(self.model, self.recording, self.windows[index], self.edit_at(index))

    def intervention_at(self, index: int) -> Intervention:
        """What was carried into the memory at window `index`: this branch's from its start, its parent's before."""
        return self._owner(index).intervention

    def edit_at(self, index: int) -> EventEdit:
        """How the events of window `index` were changed before the network saw them."""
        return self._owner(index).edit

    def plan(self, index: int) -> Seek:
        """What `at(index)` would have to do now."""
        self._check(index)
        has_frame = self.has_frame(index)
        if self._state(index) is not None:
            return Seek(index, index, 0, has_frame)
        before = self._nearest_before(index)
        return Seek(index, before, index - before, has_frame)

    def cached(self) -> CacheReport:
        """Which frames and states are held now."""
        frames = {index for index, intervention in self._frames.keys() if intervention == ORIGINAL}  # noqa: SIM118
        disk = self._usable_disk()
        frames |= frozenset() if disk is None else disk.frames
        return CacheReport(_ranges(frames), _ranges(self._states), self._frames.nbytes + self._states.nbytes)

    def has_frame(self, index: int, intervention: Intervention = ORIGINAL) -> bool:
        """Whether the frame of window `index` is held, here or on disk."""
        if (index, intervention) in self._frames:
            return True
        return intervention == ORIGINAL and (disk := self._usable_disk()) is not None and index in disk.frames

    def branch(self, at: int, intervention: Intervention = ORIGINAL, edit: EventEdit = UNEDITED) -> Playback:
        """A playback in which `intervention` and `edit` hold from window `at` on; all states before it are shared.

        They replace what this playback itself changes from there on.
        """
        self._check(at)
        branch = Playback(self.model, self.recording, self.windows, self._budget_bytes // 2, first=self.first)
        branch.intervention, branch.edit, branch.branch_at, branch.parent = intervention, edit, at, self
        return branch

    @property
    def budget_bytes(self) -> int:
        """Bytes that states and frames may take together."""
        return self._budget_bytes

    @budget_bytes.setter
    def budget_bytes(self, budget_bytes: int) -> None:
        self._budget_bytes = budget_bytes
        states = int(budget_bytes * STATE_SHARE)
        self._states.set_budget(states, self._playhead)
        self._frames.set_budget(budget_bytes - states)

    def _keep_frame(self, key: tuple[int, Intervention], frame: Tensor) -> None:
        """A frame weighs its margins too: they were cropped away, and stay with it."""
        self._frames.keep(key, frame, kept_alive((frame,)))

    def _pyramid(
        self, index: int, cancelled: Callable[[], bool] | None, progress: Callable[[int, int], None] | None
    ) -> tuple[Pyramid, State]:
        held = self._state(index)
        if held is not None:
            _raise_if(cancelled)
            return self.model.pyramid(self._input(index), held), held
        before = self._nearest_before(index)
        state, pyramid = (None, None) if before < self.first else (self._state(before), None)
        if state is None:
            before = self.first - 1  # also where its file on disk has gone since it was named
        for i in range(before + 1, index + 1):
            _raise_if(cancelled)
            pyramid, state = self.model.encode(self._input(i), state, self.intervention_at(i))
            self._owner(i)._keep_state(i, state, index)
            if progress is not None:
                progress(i - before, index - before)
        assert pyramid is not None
        assert state is not None
        return pyramid, state

    def _input(self, index: int) -> Tensor:
        return self.voxel(index)[None].to(device_of(self.model))

    def _owner(self, index: int) -> Playback:
        """The playback whose changes hold at window `index` and that keeps its state: this one or one it branches."""
        return self if self.parent is None or index >= self.branch_at else self.parent._owner(index)

    def _usable_disk(self) -> RunCache | None:
        """What is kept on disk of this run; nothing once the network runs in another way than it did."""
        return self._disk if self._disk is not None and contract_of(self.model) == self._contract else None

    def _keep_state(self, index: int, state: State, playhead: int) -> None:
        self._states.put(index, state, playhead)
        # States stay on a GPU: one that is copied off it would make every step wait for the copy.
        if device_of(self.model).type == "cpu" and (disk := self._usable_disk()) is not None:
            disk.put_state(index, state)

    def _state(self, index: int) -> State | None:
        owner = self._owner(index)
        held = owner._states.get(index)
        if held is None and (disk := owner._usable_disk()) is not None and (state := disk.state(index)) is not None:
            held = state.to(device_of(self.model))
            owner._states.put(index, held, index)
        return held

    def _nearest_before(self, index: int) -> int:
        """The nearest index before `index` whose state is held, here or before the branch; `first` − 1 for none."""
        nearest = self._states.nearest_before(index)
        if (disk := self._usable_disk()) is not None:
            for kept in sorted(
                (i for i in disk.states if (-1 if nearest is None else nearest) < i < index), reverse=True
            ):
                if self._state(kept) is not None:
                    return kept
        if self.parent is not None and (nearest is None or nearest < self.branch_at):
            nearest = self.parent._nearest_before(min(index, self.branch_at))
        return self.first - 1 if nearest is None else nearest

    def _decoding(self, intervention: Intervention, index: int) -> Intervention:
        return intervention if intervention != ORIGINAL else self.intervention_at(index)

    def _check(self, index: int, first: int | None = None) -> None:
        first = self.first if first is None else first
        if 0 <= index < first:
            raise WindowError(
                f"the memory was empty at window {first}, and window {index} lies before it: go on in time"
            )
        if not first <= index < len(self.windows):
            raise IndexError(f"{self.recording.name}: window {index} of {len(self.windows)}")


def _raise_if(cancelled: Callable[[], bool] | None) -> None:
    if cancelled is not None and cancelled():
        raise Cancelled("nobody wants this frame any more")


def _ranges(indices: Iterable[int]) -> tuple[range, ...]:
    """Sorted indices as half-open ranges."""
    ranges: list[range] = []
    for index in sorted(indices):
        if ranges and ranges[-1].stop == index:
            ranges[-1] = range(ranges[-1].start, index + 1)
        else:
            ranges.append(range(index, index + 1))
    return tuple(ranges)
