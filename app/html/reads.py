"""What the colours of a picture stand for, so that a browser can tell the value under the pointer by itself.

`static/page/pictures.js` reads these words from a picture's `data-reads`.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt8

from app.html.tones import Tones
from etnet.render.colours import hexadecimal
from etnet.render.tone import GAMMA, resolve

_STOPS = 33
"""Colours of a ramp that are handed over; between two of them it runs straight."""


def grey_reads(tones: Tones) -> str:
    """A raw frame in grey levels. Nothing where a tone depends on the whole frame: its greys name no value."""
    match resolve(tones.tone, tones.is_linear_light):
        case "gamma":
            return f"grey:0:1:{GAMMA}"
        case "raw":
            return "grey:0:1:1"
    return ""


def ramp_reads(colours: UInt8[np.ndarray, "n 3"], low: float, high: float, unit: str = "") -> str:
    """Values from `low` to `high` in the colours of a ramp, from its first to its last; `unit` stands after them."""
    chosen = colours[np.linspace(0, len(colours) - 1, _STOPS).round().astype(int)]
    stops = ",".join(hexadecimal((int(red), int(green), int(blue))) for red, green, blue in chosen)
    return f"ramp:{low:.6g}:{high:.6g}:{stops}:{unit}"
