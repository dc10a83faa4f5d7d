"""Several runs in one picture: each below its name, at the same moment, as they are or as differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float32, UInt8

from etnet.events.cleaning import Cleaning
from etnet.render.board import draw_text, text_width
from etnet.render.colours import GROUND, RUNS, Colour, diverging
from etnet.windows import BetweenFrames, ByActivity, ByCount, ByCountOrDuration, ByDensity, ByDuration, ByStamps, Policy

Sight = Literal["frames", "difference", "error"]
LIMIT = 0.5
"""Difference at the end of the colours: one scale for all runs and moments, so that they can be compared."""
SAME_TIME = 1_000
"""µs that two windows may end apart before it is said."""
LETTERS = "ABCD"
GAP = 8
"""Pixels of ground between two cells."""
TEXT, SOFT = (242, 244, 246), (168, 176, 188)
_RAMP = 60

Grey = Float32[np.ndarray, "h w"]
Picture = UInt8[np.ndarray, "h w 3"]


@dataclass(frozen=True, slots=True)
class RunTitle:
    """What stands above a run's picture, and the display gamma of its frames."""

    network: str
    settings: str = ""
    gamma: float = 1.0


@dataclass(frozen=True, slots=True)
class Runs:
    """All runs of a picture, the take's own first."""

    titles: tuple[RunTitle, ...]
    sight: Sight = "frames"
    """difference: each run minus the first; error: each minus the camera."""
    camera_error: int | None = None
    """The run (its place among the titles) whose error stands in the camera's place; `None` shows its frame."""
    numbers: tuple[int, ...] = ()
    """Which letter each has, 0 is A; empty: one after the other. Some runs of a page may have no frames."""

    def number(self, place: int) -> int:
        """Of the run at a place among the titles."""
        return self.numbers[place] if self.numbers else place


@dataclass(frozen=True, slots=True, eq=False)
class Cell:
    """One picture with its title: a letter in its hue, words, a softer second line and a note at its right."""

    image: Picture
    words: str
    letter: str = ""
    hue: Colour = TEXT
    second: str = ""
    note: str = ""
    is_signed: bool = False
    """It is a difference: the ramp of its colours stands in the second line."""


def title_of(model: Any, policy: Policy, cleaning: Cleaning, cold_from: float | None, gamma: float) -> RunTitle:
    """The title of a run; `cold_from`: the second at which its state is zero."""
    precision = getattr(getattr(model, "runtime", None), "precision", "fp32")
    parts = [policy_words(policy)]
    parts += [] if precision == "fp32" else [precision]
    parts += [] if cleaning.changes_nothing else [f"filter {cleaning.text}"]
    parts += [] if cold_from is None else [f"cold start at {cold_from:g} s"]
    return RunTitle(str(getattr(model, "name", "network")), ", ".join(parts), gamma)


def policy_words(policy: Policy) -> str:
    """A window policy in few words."""
    match policy:
        case BetweenFrames():
            return "between frames"
        case ByCount(num_events):
            return f"{num_events:,} events a window"
        case ByDensity(events_per_pixel):
            return f"{events_per_pixel:g} events per pixel"
        case ByDuration(duration, stride):
            return f"{duration / 1000:g} ms windows" + ("" if stride is None else f", one each {stride / 1000:g} ms")
        case ByCountOrDuration(num_events, duration):
            return f"{num_events:,} events or {duration / 1000:g} ms"
        case ByActivity(active_pixels):
            return f"{active_pixels:.3g} of the pixels active"
        case ByStamps():
            return "given moments"


def apart_words(microseconds: int, later: str = "later", earlier: str = "earlier") -> str:
    """How far two stamps are apart; nothing where they are as good as equal."""
    if abs(microseconds) <= SAME_TIME:
        return ""
    return f"{abs(microseconds) / 1000:.1f} ms {later if microseconds > 0 else earlier}"


def letter_and_hue(number: int) -> tuple[str, Colour]:
    """Of run `number`; 0 is the take's own."""
    return LETTERS[number], RUNS[number]


def board_of(cells: Sequence[Cell], scale: int) -> Picture:
    """The cells in one row, or in two where there are more than three."""
    num_columns = len(cells) if len(cells) <= 3 else -(-len(cells) // 2)
    drawn = [_drawn(cell, scale) for cell in cells]
    height, width = drawn[0].shape[:2]
    drawn += [_ground(height, width)] * (-len(drawn) % num_columns)
    rows = [drawn[at : at + num_columns] for at in range(0, len(drawn), num_columns)]
    joined = [_joined(row, axis=1) for row in rows]
    return _joined(joined, axis=0)


def _joined(parts: Sequence[Picture], axis: int) -> Picture:
    height, width = parts[0].shape[:2]
    gap = _ground(height, GAP) if axis == 1 else _ground(GAP, width)
    between = [part for one in parts for part in (gap, one)][1:]
    return np.concatenate(between, axis=axis)


def _drawn(cell: Cell, scale: int) -> Picture:
    image = cell.image.repeat(scale, axis=0).repeat(scale, axis=1)
    width = image.shape[1]
    capital = min(max(width / 30, 7.0), 15.0)
    strip = _ground(round(3.9 * capital), width)
    first, second, left = round(1.5 * capital), round(3.2 * capital), 2
    if cell.letter:
        draw_text(strip, cell.letter, (left, first), capital, cell.hue)
        left += text_width(cell.letter, capital) + round(capital)
    draw_text(strip, cell.words, (left, first), capital, TEXT, width - left - 2)
    right = width - 2
    if cell.note:
        note = text_width(cell.note, 0.8 * capital)
        draw_text(strip, cell.note, (max(right - note, 2), second), 0.8 * capital, SOFT, right)
        right -= note + round(capital)
    if cell.is_signed:
        _draw_ramp(strip, second, capital)
    else:
        draw_text(strip, cell.second, (2, second), 0.8 * capital, SOFT, max(right - 2, 8))
    return np.concatenate([strip, image], axis=0)


def _draw_ramp(strip: Picture, base: int, capital: float) -> None:
    """The colours of a difference between its two ends."""
    low, high, small = f"-{LIMIT:g}", f"+{LIMIT:g}", 0.8 * capital
    at = 2 + text_width(low, small) + 4
    draw_text(strip, low, (2, base), small, SOFT)
    stop = min(at + _RAMP, strip.shape[1] - 2)
    chosen = diverging()[np.linspace(0, len(diverging()) - 1, stop - at).round().astype(int)]
    strip[round(base - small) : base, at:stop] = chosen
    draw_text(strip, high, (stop + 4, base), small, SOFT)


def _ground(height: int, width: int) -> Picture:
    return np.full((height, width, 3), GROUND, np.uint8)
