"""A live recording: a source's own thread fills a bounded buffer, and what is there by now is a `Recording`."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, replace
from threading import Event, Thread

from etnet.errors import EtnetError, RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import Recording, Remark, Span
from etnet.live.buffer import Extent, Keep, LiveBuffer
from etnet.live.clock import OneWayClock
from etnet.live.rate import RateFollower
from etnet.live.source import LiveSource, Packet, Setting

NOTES = 1_000
"""Faults and changes that are remembered; older ones go."""
ARRIVALS = 2_000
"""Moments of arrival that are remembered, to tell how far behind a frame is."""


@dataclass(frozen=True, slots=True)
class Note:
    """A fault, its end, or a change of a setting: one sentence, at the stamp (µs) up to which events were there."""

    stamp: int
    text: str
    setting: Setting | None = None


@dataclass(frozen=True, slots=True)
class Loss:
    """What did not come through as it was seen."""

    packets: int = 0
    """Dropped by the computer or the network, late, or not understood."""
    held_up: int = 0
    """Events that came out of order and carry an earlier event's stamp."""


@dataclass(frozen=True, slots=True)
class Waiting:
    """What lies between the cable and us, in the camera's driver."""

    delay: float | None = None
    """Seconds that the last packet lay there; `None` where the source does not tell."""
    backlog: int = 0
    """Packets of the cable that lay there still."""


@dataclass(frozen=True)
class _Held:
    """The first `num_events` events of a buffer, as a recording's source."""

    buffer: LiveBuffer
    num_events: int

    def read(self, start: int, stop: int) -> Events:
        """Events start … stop − 1; an error if they have left the buffer."""
        return self.buffer.read(start, stop)

    def bracket(self, t: int) -> tuple[int, int] | None:
        """Where the first event stamped `t` or later lies."""
        return self.buffer.bracket(t, self.num_events)

    def close(self) -> None:
        """The buffer goes with the live recording."""


class LiveRecording:
    """Fills a buffer from `source` in a thread of its own, from `start` to `stop` or the source's end.

    `recording()` is what there is by now. An event keeps its number; those that left the buffer are an error
    that names the moment before which all is gone.
    """

    def __init__(self, source: LiveSource, keep: Keep | None = None, follower: RateFollower | None = None) -> None:
        """`follower` changes the camera's biases with the event rate."""
        self.source, self.keep = source, keep or Keep()
        self.buffer = LiveBuffer(source.sensor, self.keep)
        self._stopped, self._is_over = Event(), False
        self._notes: deque[Note] = deque(maxlen=NOTES)
        self._num_notes = 0
        self._loss, self._waiting = Loss(), Waiting()
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=ARRIVALS)
        self._arrived_at = 0.0
        self._newest: Recording | None = None
        self._clock, self._follower = OneWayClock(), follower
        self._thread = Thread(target=self._run, name=f"live {source.name}", daemon=True)

    def start(self) -> LiveRecording:
        """Begin to take events in."""
        self._thread.start()
        return self

    def stop(self) -> None:
        """End the source and its thread. What is in the buffer stays readable."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join(5.0)
        self.source.close()

    def __enter__(self) -> LiveRecording:
        return self if self._thread.is_alive() or self._is_over else self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def sensor(self) -> Sensor:
        """The size of the pixel array."""
        return self.source.sensor

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self._is_over

    @property
    def notes(self) -> tuple[Note, ...]:
        """The last faults, their ends, and changes of settings."""
        return self.notes_from(0)[1]

    def notes_from(self, first: int) -> tuple[int, tuple[Note, ...]]:
        """The notes that are remembered from number `first` on, and how many there were in all."""
        with self.buffer.changed:
            start = self._num_notes - len(self._notes)
            return self._num_notes, tuple(self._notes)[max(first - start, 0) :]

    @property
    def loss(self) -> Loss:
        """What did not come through."""
        return self._loss

    @property
    def waiting(self) -> Waiting:
        """What lay in the camera's driver when the last packet was fetched."""
        return self._waiting

    def extent(self) -> Extent:
        """What has come, and what of it is held."""
        return self.buffer.extent()

    @property
    def follower(self) -> RateFollower | None:
        """What changes the camera's biases with the event rate; `None` while nothing does."""
        return self._follower

    def follow_rate(self, follower: RateFollower | None) -> None:
        """From now on `follower` changes the camera's biases; `None` leaves them as they are. Any thread may ask."""
        self._follower = follower

    def wait(self, num_events: int = 1, timeout: float = 10.0) -> Recording:
        """The recording, once it has `num_events` events. Raises RecordingError if the source ends or stays silent."""
        until = time.monotonic() + timeout
        with self.buffer.changed:
            while (there := self.buffer.extent().num_events) < num_events:
                left = until - time.monotonic()
                if self._is_over or left <= 0:
                    why = self._notes[-1].text if self._notes else "nothing came"
                    raise RecordingError(
                        f"{self.source.name}: {there} of {num_events} events in {timeout:g} s ({why}); "
                        "move something before the camera, or wait longer"
                    )
                self.buffer.changed.wait(min(left, 0.2))
        return self.recording()

    def recording(self) -> Recording:
        """What there is by now; the same object while nothing was added."""
        with self.buffer.changed:
            held, extent, truth = self._newest, self.buffer.extent(), self.buffer.truth()
            num_frames = 0 if held is None or held.ground_truth is None else len(held.ground_truth)
            is_same = (
                held is not None
                and held.num_events == extent.num_events
                and num_frames == (0 if truth is None else len(truth))
                and (held.latest is None) == self._is_over
            )
            if held is None or not is_same:
                first, last = extent.first_stamp or 0, extent.last_stamp or 0
                _, triggers = self.buffer.triggers_from(0)
                said = Remark("detected", f"live from {self.source.name}: events leave after {self.keep.seconds:g} s")
                self._newest = held = Recording(
                    self.source.name, self.source.format, _Held(self.buffer, extent.num_events), self.sensor,
                    Span(first, last), (said,), truth, triggers=triggers if len(triggers) else None,
                    latest=None if self._is_over else self.recording,
                )  # fmt: skip
            return held

    def behind(self, stamp: int) -> float | None:
        """Seconds since the events up to `stamp` (µs) reached this machine; `None` where that was too long ago."""
        with self.buffer.changed:
            arrivals = tuple(self._arrivals)
        came = next((when for at, when in arrivals if at >= stamp), None)
        if came is None or (arrivals and stamp < arrivals[0][0] and len(arrivals) == ARRIVALS):
            return None
        return time.monotonic() - came

    def note(self, text: str, setting: Setting | None = None) -> None:
        """Remember one sentence about what happened."""
        with self.buffer.changed:
            self._notes.append(Note(self.buffer.extent().until or 0, text, setting))
            self._num_notes += 1

    def _run(self) -> None:
        try:
            for packet in self.source.packets(self._stopped.is_set):
                self._take(packet)
                if (follower := self._follower) is not None:
                    self._change_biases(follower)
                if self._stopped.is_set():
                    break
        except EtnetError as error:
            self.note(str(error))
        except Exception as error:
            self.note(f"{self.source.name}: ended by a fault of its own ({type(error).__name__}: {error})")
        finally:
            with self.buffer.changed:
                self._is_over = True
                self.buffer.changed.notify_all()

    def _change_biases(self, follower: RateFollower) -> None:
        extent = self.buffer.extent()
        if extent.until is not None:
            for name, value in follower.changes(extent.until, extent.num_events, self.source.settings()):
                self.source.change(name, value)

    def _take(self, packet: Packet) -> None:
        mended = self._clock.mended(packet)
        packet = mended.packet
        self.buffer.add(packet.events, packet.until, packet.frames, packet.triggers)
        with self.buffer.changed:
            until = self.buffer.extent().until
            self._waiting = Waiting(packet.delay, packet.backlog)
            if packet.num_lost or mended.num_held_up:
                self._loss = replace(
                    self._loss,
                    packets=self._loss.packets + packet.num_lost,
                    held_up=self._loss.held_up + mended.num_held_up,
                )
            for text in packet.notes:
                self.note(text)
            for setting in packet.changed:
                self.note(f"{setting.name} is {setting.words} now", setting)
            if len(packet.events) and until is not None:
                now = time.monotonic()
                # Packets can come by the thousand a second; a hundred moments a second are enough.
                if now - self._arrived_at > 0.01:
                    self._arrived_at = now
                    self._arrivals.append((until, now - (packet.delay or 0.0)))
