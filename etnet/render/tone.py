"""A network's raw frame → grey levels for a screen. Display only: no metric ever sees this."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float, UInt8

Tone = Literal["auto", "raw", "gamma", "robust", "hdr", "clahe"]
GAMMA = 2.2
"""A screen's exponent, near enough to sRGB: what a frame in linear light needs."""

Range = tuple[float, float]
_HDR_LOW, _HDR_HIGH = (0.0, 0.45), (0.55, 1.0)
"""Where black and white may lie for "hdr": rpg_e2vid's --auto_hdr, of one frame, so that no frame depends on others."""
_CLAHE_CLIP, _CLAHE_TILES = 2.0, (8, 8)


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


def hdr_range(frame: Float[np.ndarray, "h w"]) -> Range:
    """Minimum and maximum, kept within 0 … .45 and .55 … 1, so that a flat frame is not blown up."""
    finite = frame[np.isfinite(frame)]
    if finite.size == 0:
        return 0.0, 1.0
    return float(np.clip(finite.min(), *_HDR_LOW)), float(np.clip(finite.max(), *_HDR_HIGH))


def tone_map(frame: Float[np.ndarray, "h w"], tone: Tone, is_linear_light: bool) -> UInt8[np.ndarray, "h w"]:
    """Grey levels. "raw": 0 … 1 as they are; "gamma": 0 … 1 from linear light; "robust": 1st … 99th percentile;
    "hdr": `hdr_range`; "clahe": local contrast, limited. The last three start from linear light where the frame is
    in linear light. Not a number becomes black.
    """
    chosen = resolve(tone, is_linear_light)
    low, high = {"robust": robust_range, "hdr": hdr_range}.get(chosen, lambda _: (0.0, 1.0))(frame)
    unit = np.nan_to_num((frame - low) / (high - low), nan=0.0).clip(0, 1)
    if chosen == "gamma" or (chosen != "raw" and is_linear_light):
        unit = unit ** (1 / GAMMA)
    grey = np.rint(unit * 255).astype(np.uint8)
    return _clahe(grey) if chosen == "clahe" else grey


def _clahe(grey: UInt8[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w"]:
    """Contrast-limited adaptive histogram equalisation (Zuiderveld 1994) in 8×8 tiles."""
    import cv2

    return cv2.createCLAHE(_CLAHE_CLIP, _CLAHE_TILES).apply(np.ascontiguousarray(grey))
