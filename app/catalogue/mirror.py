"""A visitor's own camera as a recording that grows: frames in, a simulated sensor's events out. Nothing is stored.

Each visitor has one mirror. It runs while they let it, `LONGEST` seconds at most, and what it showed is forgotten.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from threading import Lock, RLock, Timer
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import UInt8

from app.catalogue.entries import Entry
from etnet.errors import Cancelled, EtnetError, RecordingError
from etnet.events.events import Events, Sensor
from etnet.events.recording import GroundTruth, Recording
from etnet.live.buffer import Keep
from etnet.live.recording import LiveRecording

if TYPE_CHECKING:
    from etnet.live.simulated import SimulatedSensor
    from etnet.live.webcam import PushedFrames

SENSOR = Sensor(160, 120)
"""What runs live on two cores."""
LONGEST = 100.0
"""Seconds for which one mirror runs: the next visitor waits."""
AT_ONCE = 2
"""Mirrors that run at the same time: they share the network with everybody."""
FEWEST_FRAMES = 3
PATIENCE = 10.0
"""Seconds in which the first frames have to come."""
FORGETS = 2.0
"""Seconds after its end for which a mirror's recording can still be read: the page is just leaving it."""
MADE_WITHIN = 90.0
"""Seconds for which it can be read longer, while its visitor's page to take home is made of it."""
KEEP = Keep(LONGEST + 20, 128 << 20)
LEAST, MOST = 0.06, 0.6
"""Contrast threshold at the two ends of the slider."""
MOST_NOISE = 3.0


class MirrorError(EtnetError):
    """The camera cannot be used now."""


class MirrorSensor:
    """Simulated pixels that look on; their settings may change between two frames."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._wanted = (0.15, 0.2)
        self._made: tuple[float, float] | None = None
        self._sensor: SimulatedSensor | None = None

    def set(self, sensitivity: float, noise: float) -> None:
        """`sensitivity` 0 … 1: from few events to many; `noise` as `VideoConfig` has it."""
        sensitivity, noise = min(max(sensitivity, 0.0), 1.0), min(max(noise, 0.0), MOST_NOISE)
        contrast = MOST * (LEAST / MOST) ** sensitivity
        with self._lock:
            self._wanted = (round(contrast, 3), round(noise, 2))

    def expose(self, grey: UInt8[np.ndarray, "h w"], t: float) -> Events:
        """The events between the frame before and this one; none at the first under another setting."""
        with self._lock:
            wanted = self._wanted
        if self._sensor is None or wanted != self._made:
            self.close()
            from etnet.live.simulated import SimulatedSensor  # not at every start: it brings the video library
            from etnet.simulation.video import VideoConfig

            self._sensor, self._made = SimulatedSensor(VideoConfig(*wanted)), wanted
        return self._sensor.expose(grey, t)

    def close(self) -> None:
        """End the simulator."""
        if self._sensor is not None:
            self._sensor.close()
            self._sensor = None


class Mirror:
    """One visitor's. `show` and `set` are called by the camera's connection, the rest by the page."""

    def __init__(self, mirrors: Mirrors, on_change: Callable[[str], None]) -> None:
        """`on_change` is told on any thread: the id of a recording that has begun, or "" when it is over."""
        self.ticket = secrets.token_urlsafe(18)
        self._on_change = on_change
        self.trouble = ""
        self.ordered = ""
        """The recording of which a page to take home is being made; empty while there is none."""
        self._mirrors = mirrors
        self._lock = RLock()
        self._live: LiveRecording | None = None
        self._frames: PushedFrames | None = None
        self._pixels = MirrorSensor()
        self._seen: _Seen | None = None
        self._id = ""
        self._began = 0.0
        self._is_closed = False
        self._is_ending = False
        """What it looked through is being put away: until then it counts, and no other camera is let in."""

    @property
    def recording_id(self) -> str:
        """What is looked at while it runs; "" otherwise."""
        return self._id

    @property
    def is_over(self) -> bool:
        """Whether it has run for as long as one may."""
        return time.monotonic() - self._began > LONGEST

    def begin(self) -> None:
        """Let the camera in. Raises MirrorError."""
        with self._lock:
            if self._is_closed:
                raise MirrorError("the page with this camera is not open any more; load it again")
            if self._live is not None:
                raise MirrorError("this page has a camera already")
            if self._is_ending:
                raise MirrorError("this page's camera is just being switched off; try again in a moment")
            self._mirrors.admit(self)
            self._pixels = MirrorSensor()
            from etnet.live.webcam import PushedFrames

            self._frames = PushedFrames("your own face", SENSOR, self._pixels)
            self._live = LiveRecording(self._frames, KEEP).start()
            self._id, self._began, self.trouble = f"mirror-{secrets.token_hex(12)}", time.monotonic(), ""
            self._seen = _Seen(self._live)
            self._mirrors.take_in(self._id, self._seen.wait)
        self._on_change(self._id)

    def show(self, grey: UInt8[np.ndarray, "h w"]) -> None:
        """Show a frame; returns when the pixels have seen it, so that no frame waits behind it."""
        with self._lock:
            frames, live = self._frames, self._live
        if frames is None or live is None:
            raise MirrorError("the camera is off")
        t = int((time.monotonic() - self._began) * 1e6)
        frames.show(grey, t)
        with live.buffer.changed:
            live.buffer.changed.wait_for(lambda: (live.extent().until or 0) >= t or live.is_over, timeout=1.0)

    def advance(self) -> None:
        """The network is free: what has come since the last window makes the next one."""
        with self._lock:
            seen = self._seen
        if seen is not None:
            seen.advance()

    def set(self, sensitivity: float, noise: float) -> None:
        """What the sliders say."""
        self._pixels.set(sensitivity, noise)

    def behind(self, stamp: int) -> float | None:
        """Seconds since the frame of this stamp (µs) came in."""
        return None if self._live is None else max(time.monotonic() - self._began - stamp / 1e6, 0.0)

    def end(self, trouble: str = "") -> None:
        """Forget all that was seen."""
        with self._lock:
            live, gone, pixels = self._live, self._id, self._pixels
            if live is None:
                return
            self._is_ending = True
            self._live, self._frames, self._seen, self._id, self.trouble = None, None, None, "", trouble
        try:
            self._on_change("")
            live.stop()
            pixels.close()
        finally:
            self._mirrors.dismiss(self, gone)
            self._is_ending = False

    def close(self) -> None:
        """The visitor has gone."""
        self._is_closed, self.ordered = True, ""
        self._on_change = lambda recording_id: None
        self.end()
        self._mirrors.leave(self)


class _Seen:
    """The recording of a mirror. Its camera frames are those at which the network was free, and no others: what lies
    between two of them is one window, however slow the network is, and no window waits."""

    def __init__(self, live: LiveRecording) -> None:
        self._live = live
        self._lock = Lock()
        self._kept: list[int] = []
        """Stamps (µs): frames of a live recording change their numbers."""
        self._newest: Recording | None = None

    def advance(self) -> None:
        """Take the newest frame for the end of the next window."""
        truth = self._live.recording().ground_truth
        if truth is None or len(truth) == 0:
            return
        newest = int(truth.stamps[-1])
        with self._lock:
            if not self._kept or newest > self._kept[-1]:
                self._kept.append(newest)

    def recording(self) -> Recording:
        """What there is by now; the same object while nothing was added."""
        with self._lock:
            kept, held = list(self._kept), self._newest
            if held is not None and held.ground_truth is not None and len(held.ground_truth) == len(kept):
                return held
            whole = self._live.recording()
            truth = whole.ground_truth
            assert truth is not None
            stamps = np.array(kept, np.int64)
            shown = GroundTruth(stamps, lambda index: truth.read_frame(int(np.searchsorted(truth.stamps, kept[index]))))
            self._newest = replace(whole, ground_truth=shown, latest=self.recording)
            return self._newest

    def wait(self, is_cancelled: Callable[[], bool]) -> Recording:
        """The recording, once it has a window with events."""
        until = time.monotonic() + PATIENCE
        while True:
            self.advance()
            if len(self._kept) >= FEWEST_FRAMES and self._live.extent().num_events:
                return self.recording()
            if is_cancelled() or self._live.is_over:
                raise Cancelled("the camera is off")
            if time.monotonic() > until:
                raise RecordingError("your camera: no change was seen in ten seconds; move, or allow the camera")
            with self._live.buffer.changed:
                self._live.buffer.changed.wait(0.1)


class Mirrors:
    """The mirrors of all visitors of a server. Safe from every thread."""

    def __init__(
        self,
        stream: Callable[[str, Callable[[Callable[[], bool]], Recording]], None],
        take_in: Callable[[Entry], None],
        let_go: Callable[[str], object],
    ) -> None:
        """`stream` and `take_in` let a recording be opened by its id; `let_go` forgets it."""
        self._stream, self._take_in, self._let_go = stream, take_in, let_go
        self._lock = threading.Lock()
        self._by_ticket: dict[str, Mirror] = {}
        self._running: set[Mirror] = set()

    def mirror(self, on_change: Callable[[str], None] = lambda recording_id: None) -> Mirror:
        """One more visitor's, whose page is told when it begins and ends."""
        made = Mirror(self, on_change)
        with self._lock:
            self._by_ticket[made.ticket] = made
        return made

    def of(self, ticket: str) -> Mirror:
        """The mirror that a page's ticket is for."""
        with self._lock:
            found = self._by_ticket.get(ticket)
        if found is None:
            raise MirrorError("the page with this camera is not open any more; load it again")
        return found

    def admit(self, mirror: Mirror) -> None:
        """Count a mirror in. Raises MirrorError where too many run."""
        with self._lock:
            if len(self._running) >= AT_ONCE:
                raise MirrorError("others look into the mirror already; try again in a minute")
            self._running.add(mirror)

    def take_in(self, recording_id: str, wait: Callable[[Callable[[], bool]], Recording]) -> None:
        """Let a mirror's recording be opened."""
        self._stream(recording_id, wait)
        self._take_in(Entry(recording_id, "Your own face", "mirror", "", Path("your own face")))

    def dismiss(self, mirror: Mirror, recording_id: str) -> None:
        """Count a mirror out, and forget its recording when its page has left it, and has what was ordered of it."""
        with self._lock:
            self._running.discard(mirror)
        self._forget_later(mirror, recording_id, time.monotonic() + MADE_WITHIN)

    def _forget_later(self, mirror: Mirror, recording_id: str, ends: float) -> None:
        def look() -> None:
            if mirror.ordered == recording_id and time.monotonic() < ends:
                self._forget_later(mirror, recording_id, ends)
            else:
                self._let_go(recording_id)

        later = Timer(FORGETS, look)
        later.daemon = True
        later.start()

    def leave(self, mirror: Mirror) -> None:
        """A visitor has gone."""
        with self._lock:
            self._by_ticket.pop(mirror.ticket, None)

    def close(self) -> None:
        """End them all."""
        with self._lock:
            mirrors = list(self._by_ticket.values())
        for mirror in mirrors:
            mirror.close()
