"""What a visitor requests to see of the model, and what comes back: plain values that cross threads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from jaxtyping import Float32

from etnet.events.cleaning import UNCLEANED, Cleaning
from etnet.events.edit import UNEDITED, EventEdit
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.windows import Policy

if TYPE_CHECKING:
    from etnet.nets.attention import Attention
    from etnet.nets.runtime import Contract

Precision = Literal["auto", "fp32", "bf16"]


class PlaybackKey(NamedTuple):
    """What shares one playback: everything of a request but its window and what is changed in it."""

    recording_id: str
    model_id: str
    precision: Precision
    policy: Policy
    cleaning: Cleaning
    cold_at: int

    @property
    def network(self) -> tuple[str, Precision]:
        """The network and its precision."""
        return self.model_id, self.precision

    @property
    def cut(self) -> tuple[Policy, Cleaning, int]:
        """How the recording is cut into windows."""
        return self.policy, self.cleaning, self.cold_at


FrameKey = tuple[PlaybackKey, tuple[object, ...]]
"""A playback, and what tells one of its frames from the others."""


@dataclass(frozen=True, slots=True)
class FrameRequest:
    """One window's reconstruction, by one model, under one plan of windows. Equal requests have equal frames."""

    recording_id: str
    model_id: str
    precision: Precision
    policy: Policy
    index: int
    wants_attention: bool = False
    intervention: Intervention = ORIGINAL
    edit: EventEdit = UNEDITED
    since: int | None = None
    """From which window on `intervention` and `edit` are carried in the memory; `None`: in this window alone."""
    once: bool = False
    """They hold in window `since` alone; later windows differ by what the memory carries on."""
    cleaning: Cleaning = UNCLEANED
    """What is taken out of the recording before it is cut into windows."""
    cold_at: int = 0
    """The plan's window at which the memory is empty; `index` counts from there."""

    @property
    def frame(self) -> tuple[object, ...]:
        """What tells its frame from every other, beside the playback."""
        return self.index, *self.change

    @property
    def key(self) -> FrameKey:
        """What tells its frame from every other."""
        return self.playback, self.frame

    @property
    def change(self) -> tuple[Intervention, EventEdit, int | None, bool]:
        """What is done to the network and its events on purpose."""
        return self.intervention, self.edit, self.since, self.once

    @property
    def is_original(self) -> bool:
        """Whether the network and its events are left as they are."""
        return self.intervention == ORIGINAL and self.edit == UNEDITED

    @property
    def needs_branch(self) -> bool:
        """Whether what is changed reaches the memory, and not the decoding alone."""
        return self.once or self.intervention.changes_memory or not self.edit.changes_nothing

    @property
    def plain(self) -> FrameRequest:
        """The same window, with nothing changed and nothing probed: what jobs of the original are about."""
        return replace(self, wants_attention=False, intervention=ORIGINAL, edit=UNEDITED, since=None, once=False)

    @property
    def playback(self) -> PlaybackKey:
        """What shares one playback: everything but the index."""
        key = self.recording_id, self.model_id, self.precision, self.policy, self.cleaning, self.cold_at
        return PlaybackKey(*key)


@dataclass(frozen=True, slots=True, eq=False)
class Ready:
    """A frame: the network's raw, unclipped output at sensor size.

    `milliseconds` is what this reply took (almost nothing for a cached frame). `is_exact`: equal, bit for bit, to the
    sequential run under `contract`. `is_approximate`: a preview from a cold start `num_warm` windows earlier.
    `is_cold`: the state has seen `num_seen` of the `warm_up` windows that it needs (`app.engine.warmth`).
    """

    request: FrameRequest
    frame: Float32[np.ndarray, "h w"]
    attention: Attention | None
    milliseconds: float
    is_exact: bool
    is_approximate: bool
    is_cold: bool
    contract: Contract
    num_warm: int
    began_at: int = 0
    """The window at which the memory was empty; above 0 where what came before left a live buffer, or was skipped."""
    num_seen: int = 0
    warm_up: int = 0
    is_former: bool = False
    """It stands in: another network, filter or cut into windows made it than is asked for now, under other numbers."""

    @property
    def key(self) -> tuple[object, ...]:
        """What tells this frame's pixels from any other's; pictures of it are shared by this."""
        return (*self.request.playback, *self.request.frame, self.is_approximate, self.began_at, self.contract)


@dataclass(frozen=True, slots=True)
class Working:
    """The request is being worked on: `done` of `total` windows, and what is being done in plain words."""

    request: FrameRequest
    done: int
    total: int
    message: str


@dataclass(frozen=True, slots=True)
class Failed:
    """The request cannot be granted; `message` says why and what to do."""

    request: FrameRequest
    message: str


@dataclass(frozen=True, slots=True)
class EngineStatus:
    """How the engine fares with one kind of request."""

    is_loading: bool
    step_milliseconds: float | None
    """One encode and one decode, measured; `None` before the first."""
    precision: str | None
    """What "auto" has become: "fp32" or "bf16"; `None` before the model is loaded."""
    num_waiting: int
    """Requests of all visitors that are not granted yet."""


Reply = Ready | Working | Failed
