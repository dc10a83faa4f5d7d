"""What a live source is: a sensor, packets of what it saw, and the settings that can be changed while it runs."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from etnet.errors import RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.triggers import Triggers


def no_triggers() -> Triggers:
    """No trigger at all."""
    return Triggers(np.empty(0, np.int64), np.empty(0, np.int16), np.empty(0, np.int8))


@dataclass(frozen=True, slots=True, eq=False)
class CameraFrame:
    """A grey picture of the sensor's ordinary camera, stamped in µs on the events' clock."""

    stamp: int
    pixels: UInt8[np.ndarray, "h w"]


@dataclass(frozen=True, slots=True)
class Setting:
    """One value of the camera that can be changed while it runs, with its bounds."""

    name: str
    value: int
    minimum: int
    maximum: int
    choices: tuple[str, ...] = ()
    """Names of the values from 0 on, where it is no number."""
    is_switch: bool = False
    """It is on (1) or off (0)."""

    @property
    def plain(self) -> int | bool | str:
        """What a file says of it."""
        return bool(self.value) if self.is_switch else self.choices[self.value] if self.choices else self.value

    @property
    def words(self) -> str:
        """Its value in words."""
        return ("on" if self.value else "off") if self.is_switch else str(self.plain)


def as_json(settings: Sequence[Setting]) -> str:
    """Names and values, for a file."""
    return json.dumps({setting.name: setting.plain for setting in settings})


@dataclass(frozen=True, slots=True, eq=False)
class Packet:
    """What a source hands over at once. Its events do not run back in time."""

    events: Events
    until: int | None = None
    """All events before this stamp (µs) are handed over; by default those before the last one's."""
    frames: tuple[CameraFrame, ...] = ()
    triggers: Triggers = field(default_factory=no_triggers)
    num_lost: int = 0
    """Packets that were lost before this one or in it: dropped by the computer, late, or not understood."""
    delay: float | None = None
    """Seconds that it waited in the driver before it was fetched; `None` where the source does not tell."""
    backlog: int = 0
    """Packets of the cable that still wait in the driver."""
    changed: tuple[Setting, ...] = ()
    """Settings that hold from here on."""
    notes: tuple[str, ...] = ()
    """Faults and their ends, one sentence each."""


@runtime_checkable
class LiveSource(Protocol):
    """Where live events come from. `packets` belongs to one thread; the others may be called from any."""

    @property
    def name(self) -> str:
        """What it is, in few words: a camera's model and serial, an address, a file."""
        ...

    @property
    def format(self) -> str:
        """How the events come, in plain words."""
        ...

    @property
    def sensor(self) -> Sensor:
        """The size of the pixel array. It does not change while the source runs."""
        ...

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        """Packets as they come, until the source is over or stopped; an empty one at least every 0.2 s or so.

        A fault that may pass (a cable, a sender that hangs up) is a packet with a note; one that ends the source is
        a RecordingError.
        """
        ...

    def settings(self) -> tuple[Setting, ...]:
        """What can be changed; nothing where the source is no camera."""
        ...

    def change(self, name: str, value: int) -> None:
        """Change a setting soon; the packet from which on it holds tells it. Raises RecordingError if it cannot be."""
        ...

    def close(self) -> None:
        """Give back the camera, socket or file."""
        ...


class WithoutSettings:
    """The part of the contract of a source that has nothing to set."""

    def settings(self) -> tuple[Setting, ...]:
        """Nothing."""
        return ()

    def change(self, name: str, value: int) -> None:
        """Refused."""
        raise RecordingError(f"{name}: cannot be set to {value}; this source has no settings")
