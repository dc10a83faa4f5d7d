"""Pictures with their titles on one dark sheet, to be kept or handed round: tiles in rows, rows in sections."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import UInt8

from etnet.render.colours import GROUND, Colour

WIDTH, MARGIN, GAP = 1680, 40, 16
"""Pixels of the sheet, of its border, between two tiles."""
LABEL = 64
"""Pixels left of a row for its label."""
TEXT, SOFT = (242, 244, 246), (168, 176, 188)
_FONT = cv2.FONT_HERSHEY_SIMPLEX
_CAPITAL = 21.0
"""Pixels of a capital letter of the font at scale 1."""
_FINE = 4
"""Letters are drawn so many times larger and averaged, which smooths their strokes."""
_PLAIN = str.maketrans({"×": "x", "…": "...", "·": "-", "–": "-", "−": "-", "µ": "u", "’": "'", "≥": ">", "≤": "<"})

Picture = UInt8[np.ndarray, "h w 3"]


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """One picture, grey or RGB, with what stands above it: its title, and a softer note at the right."""

    image: UInt8[np.ndarray, "h w"] | Picture
    title: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """Tiles of one shape, side by side, all of one width; `None` leaves a place empty. The label stands at the left."""

    tiles: Sequence[Tile | None]
    label: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Scale:
    """What the colours of a section mean: a ramp from `low` to `high`."""

    colours: UInt8[np.ndarray, "n 3"]
    low: str
    high: str


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """Rows under one title, with their colour scale at its right."""

    rows: Sequence[Row]
    title: str = ""
    scale: Scale | None = None


def board(title: str, facts: str, sections: Sequence[Section]) -> Picture:
    """The sheet: a heading and a line of facts, then the sections, one below the other."""
    head = _ground(96)
    draw_text(head, title, (MARGIN, 58), 21, TEXT, WIDTH - 2 * MARGIN)
    draw_text(head, facts, (MARGIN, 90), 12, SOFT, WIDTH - 2 * MARGIN)
    strips = [head]
    for section in sections:
        strips.append(_section_head(section) if section.title else _ground(20))
        strips += [_row(row, any(each.label for each in section.rows)) for row in section.rows]
    return np.concatenate([*strips, _ground(MARGIN - GAP)], axis=0)


def text_width(text: str, capital: float) -> int:
    """Pixels that a line takes whose capital letters are `capital` pixels high."""
    size, stroke = _pen(capital)
    (width, _), _ = cv2.getTextSize(_plain(text), _FONT, size, stroke)
    return -(-width // _FINE)


def draw_text(
    image: Picture, text: str, at: tuple[int, int], capital: float, colour: Colour, most: int | None = None
) -> None:
    """Write one line in place, `at` its left end (x) and baseline (y); it shrinks until it is no wider than `most`."""
    while most is not None and capital > 6 and text_width(text, capital) > most:
        capital -= 0.5
    x, y = at
    height, width = round(2 * capital), text_width(text, capital) + 6
    ink = np.zeros((height * _FINE, width * _FINE), np.uint8)
    base = round(1.4 * capital)
    size, stroke = _pen(capital)
    cv2.putText(ink, _plain(text), (_FINE, base * _FINE), _FONT, size, 255, stroke, cv2.LINE_AA)
    alpha = cv2.resize(ink, (width, height), interpolation=cv2.INTER_AREA)[..., None].astype(np.float32) / 255
    place = image[max(y - base, 0) : y - base + height, x : x + width]
    alpha = alpha[max(base - y, 0) :][: place.shape[0], : place.shape[1]]
    place[:] = np.rint(place * (1 - alpha) + np.array(colour, np.float32) * alpha)


def _pen(capital: float) -> tuple[float, int]:
    """The font's scale and its stroke, in fine pixels."""
    return _FINE * capital / _CAPITAL, max(1, round(_FINE * capital / 9))


def _plain(text: str) -> str:
    """What the font can write: signs beyond ASCII by their nearest, letters without their accents."""
    return unicodedata.normalize("NFKD", text.translate(_PLAIN)).encode("ascii", "ignore").decode()


def _ground(height: int) -> Picture:
    return np.full((height, WIDTH, 3), GROUND, np.uint8)


def _section_head(section: Section) -> Picture:
    strip = _ground(74)
    strip[22, MARGIN : WIDTH - MARGIN] = (52, 56, 64)
    right = WIDTH - MARGIN
    if section.scale is not None:
        right = _draw_scale(strip, section.scale, right)
    draw_text(strip, section.title, (MARGIN, 58), 14, TEXT, right - MARGIN - 24)
    return strip


def _draw_scale(strip: Picture, scale: Scale, right: int) -> int:
    """Draw a ramp with its two ends named, up to the right border; returns where it begins."""
    high, low, ramp, space = text_width(scale.high, 11), text_width(scale.low, 11), 200, 12
    draw_text(strip, scale.high, (right - high, 57), 11, SOFT)
    stop = right - high - space
    chosen = scale.colours[np.linspace(0, len(scale.colours) - 1, ramp).round().astype(int)]
    strip[46:58, stop - ramp : stop] = chosen
    left = stop - ramp - space - low
    draw_text(strip, scale.low, (left, 57), 11, SOFT)
    return left


def _row(row: Row, is_labelled: bool) -> Picture:
    tiles, begin = row.tiles, MARGIN + (LABEL if is_labelled else 0)
    width = (WIDTH - MARGIN - begin - GAP * (len(tiles) - 1)) // len(tiles)
    shown = [None if tile is None else _fitted(tile.image, width) for tile in tiles]
    height = max(image.shape[0] for image in shown if image is not None)
    caption = 34 if any(tile is not None and (tile.title or tile.note) for tile in tiles) else 0
    strip = _ground(caption + height + GAP)
    if row.label:
        draw_text(strip, row.label, (MARGIN, caption + height // 2 + 7), 14, TEXT, LABEL - 8)
    for number, (tile, image) in enumerate(zip(tiles, shown, strict=True)):
        if tile is None or image is None:
            continue
        x = begin + number * (width + GAP)
        strip[caption : caption + image.shape[0], x : x + width] = image
        note = text_width(tile.note, 10) if tile.note else 0
        if tile.title:
            draw_text(strip, tile.title, (x, 23), 11.5, TEXT, width - note - 8)
        if tile.note:
            draw_text(strip, tile.note, (x + width - note - 2, 23), 10, SOFT)
    return strip


def _fitted(image: UInt8[np.ndarray, "h w"] | Picture, width: int) -> Picture:
    """Brought to a width. Pixels stay squares of even size: enlarged by whole numbers, then averaged."""
    colour = image[..., None].repeat(3, axis=2) if image.ndim == 2 else image
    factor = -(-width // image.shape[1])
    height = round(image.shape[0] * width / image.shape[1])
    large = colour.repeat(factor, axis=0).repeat(factor, axis=1)
    return cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)
