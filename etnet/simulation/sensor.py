"""An event sensor's pixels, as ESIM models them (Rebecq et al. 2018), with the imperfections of real ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int8, Int64

from etnet.events.events import Events, Sensor
from etnet.simulation.config import SensorConfig
from etnet.simulation.draw import log_uniform

_SLOWEST = 20 / 255
"""Light that is added before bandwidth is scaled with it, as in v2e's emulator: a black pixel still follows, slowly."""


@dataclass(frozen=True, slots=True)
class SensorTraits:
    """One sensor: what was drawn from a `SensorConfig`. Thresholds in natural-log intensity, times in µs."""

    threshold_on: float
    threshold_off: float
    mismatch: float = 0.0
    refractory_us: float = 0.0
    leak_hz: float = 0.0
    shot_hz: float = 0.0
    hot_share: float = 0.0
    hot_hz: float = 0.0
    low_pass_us: float = 0.0
    lag_us: float = 0.0
    dark: float = 0.01
    cutoff_hz: float = 0.0
    """Bandwidth of a white pixel's photoreceptor; a darker one is slower in proportion to its light, as in v2e (Hu et
    al. 2021, §3.1), down to a fourteenth. 0: none. It stands beside `low_pass_us`, which is the same for all light."""


def draw_traits(config: SensorConfig, rng: np.random.Generator) -> SensorTraits:
    """A sensor from the configured ranges."""

    is_core = rng.random() < config.threshold_core_share
    threshold = log_uniform(rng, config.threshold_core if is_core else config.threshold)
    if config.balance == "normal":
        spread = max(0.1, 1 + config.balance_sigma * rng.standard_normal())
    else:
        spread = float(np.exp(config.balance_sigma * rng.standard_normal()))
    balance = config.balance_center * spread
    # Split between the two, so that the draw of the threshold keeps its meaning for both polarities.
    return SensorTraits(
        threshold_on=threshold * balance**0.5,
        threshold_off=threshold / balance**0.5,
        mismatch=float(rng.uniform(*config.mismatch)),
        refractory_us=log_uniform(rng, config.refractory_us),
        leak_hz=float(rng.uniform(*config.leak_hz)),
        shot_hz=float(rng.uniform(*config.shot_hz)),
        hot_share=float(rng.uniform(*config.hot_share)),
        hot_hz=log_uniform(rng, config.hot_hz),
        low_pass_us=log_uniform(rng, config.low_pass_us),
        lag_us=float(rng.uniform(*config.lag_us)),
        dark=log_uniform(rng, config.dark),
    )


class Crossings(NamedTuple):
    """Events of one exposure: flat pixel index, stamp in µs, polarity; in no particular order."""

    pixel: Int64[np.ndarray, " n"]
    t: Float64[np.ndarray, " n"]
    p: Int8[np.ndarray, " n"]


class PixelArray:
    """The pixels' memory. Show it one log image after the other; between two the signal runs straight.

    A pixel remembers the level of its last event (`reference`) and gives one event for each threshold that the signal
    has moved from there, at the time the straight line crosses it. What is left over stays for the next exposure.
    """

    def __init__(self, first: Float32[np.ndarray, "h w"], t: float, traits: SensorTraits, rng: np.random.Generator):
        """`first` is the light (linear, 0 … 1 is white) at time `t` (µs). Residuals begin at random."""
        shape = first.shape
        self._traits = traits
        self._t = t
        self._level = self._log(first)
        spread = traits.mismatch * rng.standard_normal((2, *shape), np.float32)
        factor = np.maximum(1 + spread, 0.2)
        self.threshold_on = (traits.threshold_on * factor[0]).astype(np.float32)
        self.threshold_off = (traits.threshold_off * factor[1]).astype(np.float32)
        reach = self.threshold_on + self.threshold_off
        self.reference = self._level + self.threshold_off - rng.random(shape, np.float32) * reach
        self._last = np.full(first.size, -np.inf)

    def restart(self, light: Float32[np.ndarray, "h w"], t: float, rng: np.random.Generator) -> None:
        """The same pixels before another scene: what they remember is new, their thresholds stay."""
        self._level, self._t = self._log(light), t
        reach = self.threshold_on + self.threshold_off
        self.reference = self._level + self.threshold_off - rng.random(light.shape, np.float32) * reach

    @property
    def level(self) -> Float32[np.ndarray, "h w"]:
        """The signal that the pixels compare now: log intensity behind the photoreceptor's low-pass."""
        return self._level

    def expose(self, light: Float32[np.ndarray, "h w"], t: float) -> Crossings:
        """Show `light` at time `t` (µs) and collect the events since the exposure before."""
        return self._advance(self._log(light), light, t)

    def expose_level(self, level: Float32[np.ndarray, "h w"], t: float) -> Crossings:
        """The same for log(light + dark); `level` is not kept and not changed."""
        light = None
        if self._traits.cutoff_hz > 0:
            light = cv2.exp(level) - np.float32(self._traits.dark)
        return self._advance(level.copy(), light, t)

    def _advance(
        self, target: Float32[np.ndarray, "h w"], light: Float32[np.ndarray, "h w"] | None, t: float
    ) -> Crossings:
        """Let the signal go to `target`, which becomes the pixels' own."""
        before, elapsed = self._level, t - self._t
        if self._traits.low_pass_us > 0:
            target -= before
            target *= np.float32(-np.expm1(-elapsed / self._traits.low_pass_us))
            target += before
        if self._traits.cutoff_hz > 0 and light is not None:
            speed = (np.clip(light, 0, 1) + np.float32(_SLOWEST)) / np.float32(1 + _SLOWEST)
            speed *= np.float32(-2 * np.pi * self._traits.cutoff_hz * elapsed * 1e-6)
            target -= before
            target *= 1 - cv2.exp(speed)
            target += before
        leaked = np.float32(self._traits.leak_hz * elapsed * 1e-6)
        if self._traits.leak_hz > 0:
            self.reference -= leaked * self.threshold_on
        signal = before, target, leaked
        gap = target - self.reference
        found = [
            self._cross(np.flatnonzero(gap >= self.threshold_on), 1, self.threshold_on, *signal, elapsed),
            self._cross(np.flatnonzero(gap <= -self.threshold_off), -1, self.threshold_off, *signal, elapsed),
        ]
        self._level, self._t = target, t
        return Crossings(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _cross(
        self,
        pixel: Int64[np.ndarray, " n"],
        p: int,
        threshold: Float32[np.ndarray, "h w"],
        before: Float32[np.ndarray, "h w"],
        after: Float32[np.ndarray, "h w"],
        leaked: np.float32,
        elapsed: float,
    ) -> Crossings:
        """`leaked`: thresholds that the memory has already fallen by, evenly since the exposure before."""
        reference = self.reference.reshape(-1)
        step, held = threshold.reshape(-1)[pixel], reference[pixel]
        # In float64, for the stamps; all further arrays are as short as the list of pixels that fire.
        start, end = before.reshape(-1)[pixel].astype(np.float64), after.reshape(-1)[pixel].astype(np.float64)
        fallen = float(leaked) * self.threshold_on.reshape(-1)[pixel]
        already = p * (start - held - fallen)
        rise = np.maximum(p * (end - start + fallen), 1e-12)
        count = (p * (end - held) / step).astype(np.int64)
        pixels, stamps = [], []
        for k in range(1, int(count.max(initial=0)) + 1):
            has_k = count >= k
            pixel_k, share = pixel[has_k], (k * step[has_k] - already[has_k]) / rise[has_k]
            t = self._t + np.minimum(np.maximum(share, 0.0), 1.0) * elapsed
            if self._traits.refractory_us > 0:
                is_ready = t - self._last[pixel_k] >= self._traits.refractory_us
                pixel_k, t = pixel_k[is_ready], t[is_ready]
                self._last[pixel_k] = t
            pixels.append(pixel_k)
            stamps.append(t)
        reference[pixel] = held + (p * count * step).astype(np.float32)
        where = np.concatenate(pixels) if pixels else np.empty(0, np.int64)
        when = np.concatenate(stamps) if stamps else np.empty(0)
        return Crossings(where, when, np.full(len(where), p, np.int8))

    def _log(self, light: Float32[np.ndarray, "h w"]) -> Float32[np.ndarray, "h w"]:
        return cv2.log(light + np.float32(self._traits.dark))


def draw_noise(
    light: Float32[np.ndarray, "h w"], span: tuple[float, float], traits: SensorTraits, rng: np.random.Generator
) -> Crossings:
    """Events that no light made, over `span` (µs): shot noise, four times rarer at white, and hot pixels."""
    seconds, num_pixels = (span[1] - span[0]) * 1e-6, light.size
    weight = 1.0 - 0.75 * np.clip(light.reshape(-1).astype(np.float64), 0, 1)
    num_shots = int(rng.poisson(traits.shot_hz * seconds * weight.sum()))
    shots = np.searchsorted(np.cumsum(weight), rng.random(num_shots) * weight.sum())
    hot = rng.choice(num_pixels, int(rng.binomial(num_pixels, traits.hot_share)), replace=False)
    fired = rng.poisson(traits.hot_hz * seconds * rng.uniform(0.2, 1.0, len(hot)))
    pixel = np.concatenate([np.minimum(shots, num_pixels - 1), np.repeat(hot, fired)]).astype(np.int64)
    polarity = np.concatenate([rng.random(num_shots) < 0.5, np.repeat(rng.random(len(hot)) < 0.7, fired)])
    return Crossings(pixel, rng.uniform(*span, len(pixel)), np.where(polarity, 1, -1).astype(np.int8))


def events_of(crossings: list[Crossings], sensor: Sensor) -> Events:
    """One ordered list of events, stamped with the whole microsecond in which they fell."""
    if not crossings:
        return Events.empty(sensor)
    pixel, t, p = (np.concatenate(column) for column in zip(*crossings, strict=True))
    stamps = np.floor(t).astype(np.int64)
    order = _order_of(stamps)
    y, x = np.divmod(pixel[order].astype(np.uint32), np.uint32(sensor.width))
    return Events(x.astype(np.uint16), y.astype(np.uint16), stamps[order], p[order], sensor)


def _order_of(stamps: Int64[np.ndarray, " n"]) -> Int64[np.ndarray, " n"]:
    """Indices that put stamps in order; equal ones stay as they are.

    By 16 bits at a time, which numpy sorts in a fifth of the time that it takes for whole numbers.
    """
    if len(stamps) == 0:
        return np.empty(0, np.int64)
    later = stamps - stamps.min()
    order = np.argsort((later & 0xFFFF).astype(np.uint16), kind="stable")
    for shift in range(16, int(later.max()).bit_length(), 16):
        digit = (later[order] >> shift & 0xFFFF).astype(np.uint16)
        order = order[np.argsort(digit, kind="stable")]
    return order
