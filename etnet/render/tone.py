"""A network's raw frame → grey levels for a screen. Display only: no metric ever sees this."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float, UInt8

Tone = Literal["auto", "raw", "gamma", "robust"]
GAMMA = 2.2
"""A screen's exponent, near enough to sRGB: what a frame in linear light needs."""

Range = tuple[float, float]


def resolve(tone: Tone, is_linear_light: bool) -> Tone:
    """What "auto" means: gamma for frames in linear light, the values as they are for all others."""
    if tone != "auto":
        return tone
    return "gamma" if is_linear_light else "raw"


def robust_range(frame: Float[np.ndarray, "h w"]) -> Range:
    """The 1st and 99th percentile; a flat frame gets a range of its own around its value."""
    finite = frame[np.isfinite(frame)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = (float(v) for v in np.percentile(finite, (1, 99)))
    return (low, high) if high - low > 1e-6 else (low - 0.5, low + 0.5)


def tone_map(frame: Float[np.ndarray, "h w"], tone: Tone, is_linear_light: bool) -> UInt8[np.ndarray, "h w"]:
    """Grey levels. "raw": 0 … 1 as they are; "gamma": 0 … 1 from linear light; "robust": 1st … 99th percentile,
    from linear light where the frame is in linear light. Not a number becomes black.
    """
    chosen = resolve(tone, is_linear_light)
    low, high = robust_range(frame) if chosen == "robust" else (0.0, 1.0)
    unit = np.nan_to_num((frame - low) / (high - low), nan=0.0).clip(0, 1)
    if chosen == "gamma" or (chosen == "robust" and is_linear_light):
        unit = unit ** (1 / GAMMA)
    return np.rint(unit * 255).astype(np.uint8)
