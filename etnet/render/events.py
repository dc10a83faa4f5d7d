"""Event images: one picture of the events of a window, as people of this field read them."""

from __future__ import annotations

from functools import cache
from typing import Literal, get_args

import numpy as np
from jaxtyping import Int64, UInt8

from etnet.events.events import Events
from etnet.render.colours import GROUND, OFF, ON, counting, diverging, diverging_levels
from etnet.render.encode import Indexed

EventStyle = Literal["polarity", "count", "time surface", "decay"]
EVENT_STYLES: tuple[EventStyle, ...] = get_args(EventStyle)

BUSY = 4
"""Events on one pixel from which the polarity picture shows its hue at full strength."""
SHADES = 127
"""Steps of a hue in the time surface."""


def event_image(events: Events, style: EventStyle, t_start: int, t_stop: int) -> tuple[Indexed, float]:
    """The picture and the number its brightest colour stands for.

    "polarity": the hue of each pixel's newest event, stronger where there were more (limit: events).
    "count": how many events (limit: events, 99th percentile of the active pixels).
    "time surface": the hue of the newest event, fading linearly with its age (limit: ms, the window's length).
    "decay": Σ p · exp(−age / τ) with τ a third of the window (limit: signed events, 99th percentile).
    Stamps in µs; ages run back from `t_stop`.
    """
    height, width = events.sensor.height, events.sensor.width
    pixel = events.y.astype(np.int64) * width + events.x
    size = height * width
    duration = max(t_stop - t_start, 1)
    if style == "count":
        counts = np.bincount(pixel, minlength=size).reshape(height, width)
        limit = _percentile(counts, 99)
        return Indexed(np.rint(np.clip(counts / limit, 0, 1) * 255).astype(np.uint8), counting()), limit
    if style == "decay":
        weights = events.p * np.exp((events.t - t_stop) * (3 / duration))
        signed = np.bincount(pixel, weights, size).reshape(height, width)
        limit = _percentile(np.abs(signed), 99)
        return Indexed(diverging_levels(signed, limit), diverging()), limit
    newest = np.zeros(size, np.int8)
    newest[pixel] = events.p  # of equal indices the last one stays
    if style == "polarity":
        shade = np.clip(np.bincount(pixel, minlength=size) - 1, 0, BUSY - 1)
        palette, limit = _hues(0.5, BUSY), float(BUSY)
    else:
        stamps = np.full(size, t_start, np.int64)
        stamps[pixel] = events.t
        shade = np.rint(np.clip((stamps - t_start) / duration, 0, 1) * (SHADES - 1))
        palette, limit = _hues(0.08, SHADES), duration / 1000
    num_shades = len(palette) // 2
    level = np.where(newest > 0, 1, 1 + num_shades) + shade
    return Indexed(np.where(newest == 0, 0, level).astype(np.uint8).reshape(height, width), palette), limit


def polarity_colours(events: Events, chosen: Int64[np.ndarray, " n"] | slice = slice(None)) -> UInt8[np.ndarray, "n 3"]:
    """One colour an event, of those that are `chosen` by their numbers."""
    return np.array([OFF, ON], np.uint8)[(events.p[chosen] > 0).astype(np.intp)]


@cache
def _hues(weakest: float, num_shades: int) -> UInt8[np.ndarray, "n 3"]:
    """GROUND, then ON and then OFF, each from its weakest shade to its full hue."""
    strength = np.linspace(weakest, 1, num_shades, dtype=np.float32)[:, None]
    ground = np.asarray(GROUND, np.float32)
    sides = [ground + (np.asarray(hue, np.float32) - ground) * strength for hue in (ON, OFF)]
    return np.rint(np.concatenate([ground[None], *sides])).astype(np.uint8)


def _percentile(values: np.ndarray, percent: float) -> float:
    active = values[values > 0]
    return float(np.percentile(active, percent)) if active.size else 1.0
