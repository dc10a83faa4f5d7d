"""Attention rows → overlays. Values are told as "× uniform": 1 is what a token would get if all were read alike."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from etnet.render.colours import QUERY, sequential

LOWEST, HIGHEST = 0.25, 32.0
"""× uniform at which the shared, logarithmic range begins and ends."""
DIM = 0.6
"""How much of the frame's brightness stays under the overlay."""


def times_uniform(row: Float[np.ndarray, "*maps keys"]) -> Float[np.ndarray, "*maps keys"]:
    """Weights that sum to 1 → how many times the uniform share each key gets."""
    return row * row.shape[-1]


def log_level(relative: Float[np.ndarray, "*shape"], highest: float = HIGHEST) -> Float[np.ndarray, "*shape"]:
    """× uniform → 0 … 1 over LOWEST … `highest`, logarithmically."""
    floor = np.maximum(relative, LOWEST)
    return (np.log2(floor / LOWEST) / np.log2(max(highest, 2 * LOWEST) / LOWEST)).clip(0, 1)


def linear_level(relative: Float[np.ndarray, "*shape"], highest: float = HIGHEST) -> Float[np.ndarray, "*shape"]:
    """× uniform → 0 … 1 over 0 … `highest`, linearly."""
    return (relative / max(highest, LOWEST)).clip(0, 1)


def tokens_read(row: Float[np.ndarray, "*maps keys"]) -> Float[np.ndarray, "*maps"]:
    """To how many tokens a row amounts: exp of its entropy. One token gives 1, all alike give their number."""
    return np.exp(-(row * np.log(np.maximum(row, 1e-30))).sum(-1))


def overlay(
    row: Float[np.ndarray, "*maps keys"], rows: int, columns: int, highest: float = HIGHEST, opacity: float = 1.0
) -> UInt8[np.ndarray, "*maps rows columns 4"]:
    """One RGBA pixel a token. Opacity rises with attention, so what is not read stays the dimmed frame."""
    level = log_level(times_uniform(row), highest).reshape(*row.shape[:-1], rows, columns)
    return level_overlay(level, opacity)


def level_overlay(
    level: Float[np.ndarray, "*maps rows columns"], opacity: float = 1.0
) -> UInt8[np.ndarray, "*maps rows columns 4"]:
    """0 … 1 → RGBA, as `overlay` colours it."""
    alpha = opacity * level**1.4  # alike attention (1 ×) is a faint veil, not a wash
    colours = sequential()[np.rint(level * 255).astype(np.uint8)]
    return np.concatenate([colours, np.rint(alpha * 255).astype(np.uint8)[..., None]], axis=-1)


def dimmed(frame: UInt8[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w"]:
    """The frame as it lies under an overlay."""
    return np.rint(frame * DIM).astype(np.uint8)


def on_grid(
    frame: UInt8[np.ndarray, "h w"], rows: int, columns: int, top: int, left: int, patch: int
) -> UInt8[np.ndarray, "hp wp"]:
    """The frame in its place on the padded token grid, black where there is only padding."""
    padded = np.zeros((rows * patch, columns * patch), np.uint8)
    height, width = frame.shape
    padded[top : top + height, left : left + width] = frame
    return padded


def composite(
    frame: UInt8[np.ndarray, "h w"],
    tokens: UInt8[np.ndarray, "rows columns 4"],
    top: int,
    left: int,
    patch: int,
    query: tuple[int, int] | None,
    is_smooth: bool = False,
) -> UInt8[np.ndarray, "h w 3"]:
    """One map over the dimmed frame, the query (x, y) marked: `patch` whole pixels a token, or smooth."""
    height, width = frame.shape
    if is_smooth:
        large = cv2.resize(tokens, None, fx=patch, fy=patch, interpolation=cv2.INTER_LINEAR)
    else:
        large = tokens.repeat(patch, axis=0).repeat(patch, axis=1)
    large = large[top : top + height, left : left + width]
    alpha = large[..., 3:].astype(np.float32) / 255
    under = dimmed(frame)[..., None]
    image = np.rint(under * (1 - alpha) + large[..., :3] * alpha).astype(np.uint8)
    if query is not None:
        draw_query(image, query)
    return image


def draw_query(image: UInt8[np.ndarray, "h w 3"], query: tuple[int, int]) -> None:
    """Mark pixel (x, y) in place: a white cross with a dark edge, to be seen on any ground."""
    size = max(9, min(image.shape[:2]) // 14)
    for colour, thickness in (((0, 0, 0), 3), (QUERY, 1)):
        cv2.drawMarker(image, query, colour, cv2.MARKER_CROSS, size, thickness, cv2.LINE_8)
