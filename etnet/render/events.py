"""Event images: one picture of the events of a window, as people of this field read them."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from jaxtyping import Float32, Int8, UInt8

from etnet.events.events import Events
from etnet.render.colours import GROUND, OFF, ON, counting, diverge

EventStyle = Literal["polarity", "count", "time surface", "decay"]
EVENT_STYLES: tuple[EventStyle, ...] = get_args(EventStyle)

BUSY = 4
"""Events on one pixel from which the polarity picture shows its hue at full strength."""


def event_image(
    events: Events, style: EventStyle, t_start: int, t_stop: int
) -> tuple[UInt8[np.ndarray, "h w 3"], float]:
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
        shade = np.rint(np.clip(counts / limit, 0, 1) * 255).astype(np.uint8)
        return counting()[shade], limit
    if style == "decay":
        weights = events.p * np.exp((events.t - t_stop) * (3 / duration))
        signed = np.bincount(pixel, weights, size).reshape(height, width)
        limit = _percentile(np.abs(signed), 99)
        return diverge(signed, limit), limit
    newest = np.zeros(size, np.int8)
    newest[pixel] = events.p  # of equal indices the last one stays
    if style == "polarity":
        strength = 0.5 + 0.5 * np.clip((np.bincount(pixel, minlength=size) - 1) / (BUSY - 1), 0, 1)
        limit = float(BUSY)
    else:
        stamps = np.full(size, t_start, np.int64)
        stamps[pixel] = events.t
        strength = 0.08 + 0.92 * np.clip((stamps - t_start) / duration, 0, 1)
        limit = duration / 1000
    return _hued(newest, strength.astype(np.float32)).reshape(height, width, 3), limit


def polarity_colours(events: Events) -> UInt8[np.ndarray, "n 3"]:
    """One colour an event."""
    return np.array([OFF, ON], np.uint8)[(events.p > 0).astype(np.intp)]


def _hued(sign: Int8[np.ndarray, " n"], strength: Float32[np.ndarray, " n"]) -> UInt8[np.ndarray, "n 3"]:
    ground = np.asarray(GROUND, np.float32)
    hues = np.array([GROUND, ON, OFF], np.float32)[sign]  # index −1 is the last row
    return np.rint(ground + (hues - ground) * strength[:, None]).astype(np.uint8)


def _percentile(values: np.ndarray, percent: float) -> float:
    active = values[values > 0]
    return float(np.percentile(active, percent)) if active.size else 1.0
