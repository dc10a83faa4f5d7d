"""Frames with stamps go in one by one, events come out: for files, growing videos, a webcam and arrays alike."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from jaxtyping import Float32

from etnet.events.events import Events, Sensor
from etnet.simulation.beginning import Beginning
from etnet.simulation.footage import Frame
from etnet.simulation.noise import Noise
from etnet.simulation.sensor import Crossings, PixelArray, SensorTraits, events_of
from etnet.simulation.walk import Passage, Stepping, Walk, flow_of


@dataclass(eq=False, slots=True)
class Account:
    """What a simulation met by now."""

    num_frames: int = 0
    num_events: int = 0
    num_steps: int = 0
    failed: float = 0.0
    """Sum over frames of the share of the picture in which no motion was found."""
    largest_change: float = 0.0
    """Of log intensity between two frames, over all pixels."""
    num_cuts: int = 0
    cuts: deque[float] = field(default_factory=lambda: deque(maxlen=100))
    """µs at which a new scene begins; the latest hundred."""

    def sentences(self, threshold: float) -> list[str]:
        """What should be said of it."""
        said, pairs = [], max(self.num_frames - 1, 1)
        if self.num_cuts:
            places = ", ".join(f"{t / 1e6:.2f}" for t in list(self.cuts)[:5])
            more = " …" if self.num_cuts > 5 else ""
            cuts = f"{self.num_cuts} cut{'s' * (self.num_cuts > 1)}"
            said.append(f"{cuts}, at {places}{more} s: the sensor starts again at each")
        if self.failed / pairs > 0.005:
            said.append(f"no motion was found in {self.failed / pairs:.1%} of the picture: straight lines there")
        if self.num_events == 0:
            said.append(
                f"0 events: log intensity changes by {self.largest_change:.3f} at most from frame to frame, an event "
                f"takes {threshold:g}; lower the thresholds, or check that something moves"
            )
        return said


class EventSimulator:
    """A modelled sensor that frames are shown to. It keeps a few frames, whatever the length; `close` ends its threads.

    Events are those of ESIM (Rebecq et al. 2018) with v2e's imperfections. The same frames, settings and seed give the
    same events, bit for bit, for any `threads`.
    """

    def __init__(
        self,
        traits: SensorTraits,
        stepping: Stepping | None = None,
        seed: int = 0,
        threads: int = 2,
        exposure_us: float = 0.0,
        beginning: Beginning | None = None,
    ) -> None:
        self.traits, self.account = traits, Account()
        self.camera: Float32[np.ndarray, "h w"] | None = None
        """Light that an ordinary camera with `exposure_us` collected up to the newest frame."""
        self.flow: Float32[np.ndarray, "2 h w"] | None = None
        """How far what each pixel of the newest frame shows has come since the one before, x and y in pixels."""
        threshold = min(traits.threshold_on, traits.threshold_off)
        is_sampled = exposure_us > 0 or traits.cutoff_hz > 0 or traits.low_pass_us > 0
        stepping = replace(stepping or Stepping(), is_sampled=is_sampled)
        self._walk = Walk(stepping, traits.dark, threshold, threads, beginning)
        self._rng, self._exposure_us = np.random.default_rng(seed), exposure_us
        self._pixels: PixelArray | None = None
        self._noise: Noise | None = None
        self._held: list[Crossings] = []
        self._exposed: deque[tuple[float, float, Float32[np.ndarray, "h w"]]] = deque()

    def feed(self, light: Float32[np.ndarray, "h w"], t: float, starts_scene: bool = False) -> Events:
        """Show the next frame (linear light, 1 is white; `t` in µs, ascending): the events since the one before."""
        return self.expose(self._walk.to(Frame(t, light, is_cut=starts_scene)))

    def run(self, frames: Iterable[Frame]) -> Iterator[tuple[Frame, Events]]:
        """All frames in turn, each with the events since the one before; flow is looked for a little ahead."""
        for passage in self._walk.over(frames):
            yield passage.frame, self.expose(passage)

    def expose(self, passage: Passage) -> Events:
        """Let the pixels look on while the scene goes on to the passage's frame."""
        frame, account = passage.frame, self.account
        sensor = Sensor(frame.light.shape[1], frame.light.shape[0])
        account.num_frames += 1
        self.camera, self.flow = frame.light, flow_of(passage.between)
        if self._pixels is None or self._noise is None or passage.begins is None:
            self._pixels = PixelArray(frame.light, frame.t, self.traits, self._rng)
            self._noise = Noise(frame.light.size, self.traits, self._rng)
            return Events.empty(sensor)
        if passage.is_cut:
            account.cuts.append(frame.t)
            account.num_cuts += 1
            self._exposed.clear()
            self._pixels.restart(frame.light, frame.t, self._rng)
            found = []
        else:
            account.largest_change = max(account.largest_change, passage.change)
            account.failed += 0.0 if passage.between is None else passage.between.failed
            account.num_steps += passage.num_steps
            found = self._look_on(self._pixels, passage)
        found.append(self._noise.draw(frame.light, (passage.begins, frame.t), self._rng))
        return self._due(found, frame.t, sensor)

    def finish(self) -> Events:
        """Events that the lag holds back after the last frame."""
        held, self._held = self._held, []
        shape = (1, 1) if self._pixels is None else self._pixels.level.shape
        events = events_of(held, Sensor(shape[1], shape[0]))
        self.account.num_events += len(events)
        return events

    def close(self) -> None:
        """End the threads."""
        self._walk.close()

    def __enter__(self) -> EventSimulator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _look_on(self, pixels: PixelArray, passage: Passage) -> list[Crossings]:
        found = list[Crossings]()
        opens, before = passage.frame.t - self._exposure_us, passage.begins or 0.0
        for t, level in passage.steps:
            crossings = pixels.expose_level(level, t)
            found.append(crossings._replace(t=crossings.t + self.traits.lag_us))
            if t > opens:
                self._exposed.append((t, t - before, cv2.exp(level) - np.float32(self.traits.dark)))
            before = t
        # An exposure may be longer than the way from one frame to the next, of fast films and of photos in motion.
        while self._exposed and self._exposed[0][0] <= opens:
            self._exposed.popleft()
        if self._exposed:
            spans = np.array([span for _, span, _ in self._exposed], np.float32)
            self.camera = np.tensordot(spans / spans.sum(), np.stack([light for _, _, light in self._exposed]), 1)
        return found

    def _due(self, found: list[Crossings], t: float, sensor: Sensor) -> Events:
        """What has come by now, in order; what the lag carries past `t` is held."""
        if self.traits.lag_us > 0:
            every = Crossings(*(np.concatenate(column) for column in zip(*self._held, *found, strict=True)))
            is_due = every.t < t
            found = [Crossings(*(column[is_due] for column in every))]
            self._held = [Crossings(*(column[~is_due] for column in every))]
        events = events_of(found, sensor)
        self.account.num_events += len(events)
        return events
