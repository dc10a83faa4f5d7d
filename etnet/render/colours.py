"""The colours of the project: two hues for polarity, used everywhere, and ramps that are even in OKLab.

Orange and blue stay apart for every common colour blindness; attention is green to pale yellow, so that it is never
taken for polarity. OKLab: Björn Ottosson, "A perceptual color space for image processing", 2020.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from jaxtyping import Float, UInt8

Colour = tuple[int, int, int]
"""Red, green, blue in 0 … 255 (sRGB)."""

ON: Colour = (255, 158, 74)
"""Polarity +1: it became brighter."""
OFF: Colour = (86, 176, 255)
"""Polarity −1: it became darker."""
GROUND: Colour = (16, 18, 22)
"""Where nothing happened."""
QUERY: Colour = (255, 255, 255)
"""The token that was clicked."""

RUNS: tuple[Colour, ...] = ((255, 255, 255), (185, 176, 245), (242, 226, 78), (95, 214, 184))
"""Runs A, B, C, D in pictures and curves: apart from each other, and from polarity, for every common colour
blindness."""

LEVELS = 127
"""Steps on either side of zero in the diverging ramp."""

_TO_CONE = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)


def hexadecimal(colour: Colour) -> str:
    """`#rrggbb`."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def oklab(colours: Sequence[Colour]) -> Float[np.ndarray, "n 3"]:
    """sRGB → OKLab: lightness in 0 … 1, then green–red, blue–yellow."""
    encoded = np.asarray(colours, float) / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return np.cbrt(linear @ _TO_CONE.T) @ _TO_LAB.T


def srgb(lab: Float[np.ndarray, "n 3"]) -> UInt8[np.ndarray, "n 3"]:
    """OKLab → sRGB, clipped to what a screen can show."""
    linear = ((lab @ np.linalg.inv(_TO_LAB).T) ** 3 @ np.linalg.inv(_TO_CONE).T).clip(0, 1)
    encoded = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255).astype(np.uint8)


def ramp(stops: Sequence[tuple[float, Colour]], size: int) -> UInt8[np.ndarray, "size 3"]:
    """Colours from the first stop to the last, evenly in OKLab; stops are (position in 0 … 1, colour)."""
    positions, colours = zip(*stops, strict=True)
    lab = oklab(colours)
    at = np.linspace(0, 1, size)
    return srgb(np.stack([np.interp(at, positions, lab[:, axis]) for axis in range(3)], axis=1))


def _tint(colour: Colour, towards_white: float) -> Colour:
    red, green, blue = (round(c + (255 - c) * towards_white) for c in colour)
    return red, green, blue


@cache
def diverging() -> UInt8[np.ndarray, "n 3"]:
    """OFF ← dark → ON in 2 · LEVELS + 1 colours; the middle is exactly GROUND. Full hue at 70 %, paler at the ends."""
    sides = [ramp([(0, GROUND), (0.7, hue), (1, _tint(hue, 0.55))], LEVELS + 1) for hue in (OFF, ON)]
    return np.concatenate([sides[0][::-1], sides[1][1:]])


@cache
def sequential() -> UInt8[np.ndarray, "256 3"]:
    """Dark green → pale yellow, lightness rising all the way: attention."""
    return ramp([(0, (14, 52, 56)), (0.45, (22, 148, 112)), (0.75, (130, 212, 92)), (1, (250, 248, 180))], 256)


@cache
def counting() -> UInt8[np.ndarray, "256 3"]:
    """GROUND → white: how many, regardless of polarity."""
    return ramp([(0, GROUND), (1, (255, 255, 255))], 256)


def diverge(values: Float[np.ndarray, "*shape"], limit: float) -> UInt8[np.ndarray, "*shape 3"]:
    """Signed values → colours; ±`limit` and beyond take the ends of the ramp, 0 is GROUND."""
    return diverging()[diverging_levels(values, limit)]


def diverging_levels(values: Float[np.ndarray, "*shape"], limit: float) -> UInt8[np.ndarray, "*shape"]:
    """The same as places in the ramp `diverging`."""
    level = np.clip(values, -limit, limit)
    level *= LEVELS / limit
    np.rint(level, out=level)
    level += LEVELS
    return level.astype(np.uint8)


def css_gradient(colours: UInt8[np.ndarray, "n 3"], num_stops: int = 13) -> str:
    """A CSS gradient, left to right, that shows a ramp in a legend."""
    chosen = colours[np.linspace(0, len(colours) - 1, num_stops).round().astype(int)]
    return "linear-gradient(90deg," + ",".join(hexadecimal((int(r), int(g), int(b))) for r, g, b in chosen) + ")"
