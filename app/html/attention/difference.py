"""The difference of two maps, coloured: a signed log ratio in hues that are not those of polarity."""

from __future__ import annotations

from functools import cache

import numpy as np
from jaxtyping import Float, UInt8

from app.html.elements import legend
from app.html.units import short
from etnet.render.colours import Colour, css_gradient, ramp

THEN: Colour = (196, 138, 255)
NOW: Colour = (166, 226, 96)
_MIDDLE: Colour = (34, 36, 46)


@cache
def _hues() -> UInt8[np.ndarray, "255 3"]:
    return ramp([(0.0, THEN), (0.5, _MIDDLE), (1.0, NOW)], 255)


def difference_tokens(
    log_ratio: Float[np.ndarray, " tokens"], limit: float, rows: int, columns: int, opacity: float = 1.0
) -> UInt8[np.ndarray, "rows columns 4"]:
    """log₂(now / then) as one RGBA pixel a token; where both maps are alike the frame below is seen."""
    share = (log_ratio / max(limit, 1e-6)).clip(-1, 1)
    colours = _hues()[np.rint(share * 127 + 127).astype(np.uint8)]
    alpha = np.rint(np.abs(share) ** 0.8 * 255 * opacity).astype(np.uint8)
    return np.concatenate([colours, alpha[:, None]], axis=1).reshape(rows, columns, 4)


def difference_legend(limit: float) -> str:
    """The scale of a difference, in multiples of a weight; ends at which colours are clipped say so."""
    most = short(2**limit)
    ticks = [(0.0, f"≥ {most} × more then"), (0.5, "alike"), (1.0, f"≥ {most} × more now")]
    return legend("log₂ (now / then), weights below 1/64 × uniform count as that", css_gradient(_hues()), ticks)
