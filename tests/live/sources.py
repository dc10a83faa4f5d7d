"""Sources for tests: packets that are given, one after the other."""

import threading
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from etnet.events.events import Events, Sensor
from etnet.events.triggers import Triggers
from etnet.live.recording import LiveRecording
from etnet.live.source import CameraFrame, Packet, WithoutSettings
from tests.strategies import SMALL, make_events


class GivenPackets(WithoutSettings):
    """Hands packets over as fast as they are taken; `gate`, if given, is waited for before each."""

    format = "made up"

    def __init__(
        self, packets: Sequence[Packet], sensor: Sensor = SMALL, gate: threading.Semaphore | None = None
    ) -> None:
        self.name, self.sensor = "given", sensor
        self._packets, self._gate = packets, gate
        self.is_closed = False

    def packets(self, is_stopped: Callable[[], bool]) -> Iterator[Packet]:
        for packet in self._packets:
            while self._gate is not None and not self._gate.acquire(timeout=0.05):
                if is_stopped():
                    return
            yield packet

    def close(self) -> None:
        self.is_closed = True


def cut_up(events: Events, size: int) -> list[Packet]:
    """The events in packets of `size`."""
    return [Packet(events[i : i + size]) for i in range(0, len(events), size)]


def taken_in(packets: Sequence[Packet], sensor: Sensor = SMALL, keep=None) -> LiveRecording:
    """A live recording that has taken all packets in."""
    live = LiveRecording(GivenPackets(packets, sensor), keep).start()
    wait_for(lambda: live.is_over)
    return live


def wait_for(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until, "waited too long"
        time.sleep(0.005)


def same(one: Events, other: Events) -> bool:
    return all(np.array_equal(getattr(one, axis), getattr(other, axis)) for axis in "xytp")


def frames_at(stamps: Sequence[int], sensor: Sensor = SMALL) -> tuple[CameraFrame, ...]:
    rng = np.random.default_rng(1)
    return tuple(CameraFrame(t, rng.integers(0, 256, (sensor.height, sensor.width)).astype(np.uint8)) for t in stamps)


def edges_at(stamps: Sequence[int]) -> Triggers:
    num = len(stamps)
    return Triggers(
        np.array(stamps, np.int64), np.arange(num).astype(np.int16) % 2, (np.arange(num) % 3 - 1).astype(np.int8)
    )


__all__ = ["GivenPackets", "cut_up", "edges_at", "frames_at", "make_events", "same", "taken_in", "wait_for"]
