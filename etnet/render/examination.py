"""The doctor's findings as one picture: event rate, events per pixel, steps between events."""

from __future__ import annotations

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from etnet.events.examine import Examination
from etnet.render.colours import sequential

WIDTH, HEIGHT, MARGIN = 960, 540, 24
_BACKGROUND, _PAPER, _INK, _BAR = (18, 18, 20), (30, 30, 34), (225, 225, 225), (255, 178, 102)
_FONT = cv2.FONT_HERSHEY_SIMPLEX

Box = tuple[int, int, int, int]


def draw_examination(found: Examination) -> UInt8[np.ndarray, "h w 3"]:
    """A 960 × 540 RGB picture."""
    image = np.full((HEIGHT, WIDTH, 3), _BACKGROUND, np.uint8)
    half = WIDTH // 2
    rate: Box = (MARGIN, 60, WIDTH - 2 * MARGIN, 120)
    counts: Box = (MARGIN, 230, half - 2 * MARGIN, HEIGHT - 230 - MARGIN)
    steps: Box = (half + MARGIN // 2, 230, half - 2 * MARGIN + MARGIN // 2, HEIGHT - 230 - MARGIN - 16)
    seconds = (found.stop - found.start) / 1e6
    _write(
        image,
        f"{found.name}  {found.width}x{found.height}  {found.num_events:,} events  {seconds:.3f} s",
        (MARGIN, 28),
        0.6,
    )
    _write(image, f"events a second, up to {found.peak_rate / 1e6:.2f} M", (rate[0], rate[1] - 8))
    _bars(image, rate, np.asarray(found.rates))
    _write(
        image,
        f"events per {_place(found)} (99.5 % have at most {_limit(found):.0f}); {len(found.hot_pixels)} hot",
        (counts[0], counts[1] - 8),
    )
    _counts(image, counts, found)
    _write(image, "microseconds from one event to the next", (steps[0], steps[1] - 8))
    _bars(image, steps, np.log1p(np.asarray(found.step_counts)))
    for i in range(0, len(found.step_edges), 3):
        x = steps[0] + round(steps[2] * i / len(found.step_edges))
        _write(image, f"{found.step_edges[i]:,}", (x, steps[1] + steps[3] + 15), 0.38)
    return image


def _place(found: Examination) -> str:
    return "pixel" if found.cell == 1 else f"{found.cell} x {found.cell} pixels"


def _limit(found: Examination) -> float:
    fired = found.count_image[found.count_image > 0]
    return float(np.percentile(fired, 99.5)) if fired.size else 1.0


def _bars(image: UInt8[np.ndarray, "h w 3"], box: Box, heights: Float[np.ndarray, " n"]) -> None:
    x, y, width, height = box
    image[y : y + height, x : x + width] = _PAPER
    highest = heights.max(initial=0)
    if not highest > 0:
        return
    edges = np.linspace(0, width, len(heights) + 1).round().astype(int)
    for value, start, stop in zip(heights / highest, edges[:-1], edges[1:], strict=True):
        image[
            y + height - round(float(value) * height) : y + height,
            x + start : x + max(stop - (stop - start > 4), start + 1),
        ] = _BAR


def _counts(image: UInt8[np.ndarray, "h w 3"], box: Box, found: Examination) -> None:
    x, y, width, height = box
    level = np.clip(found.count_image / _limit(found), 0, 1)
    picture = sequential()[(level * 255).astype(np.uint8)]
    share = min(width / found.width, height / found.height)
    size = max(1, round(found.width * share)), max(1, round(found.height * share))
    picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if share < 1 else cv2.INTER_NEAREST)
    image[y : y + size[1], x : x + size[0]] = picture


def _write(image: UInt8[np.ndarray, "h w 3"], text: str, place: tuple[int, int], size: float = 0.45) -> None:
    plain = text.encode("ascii", "replace").decode()
    cv2.putText(image, plain, place, _FONT, size, _INK, 1, cv2.LINE_AA)
