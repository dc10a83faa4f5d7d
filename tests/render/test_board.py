"""A sheet: all of its tiles at their width, and no letter beyond what it was given."""

import numpy as np
import pytest

from etnet.render.board import GAP, MARGIN, SOFT, WIDTH, Row, Scale, Section, Tile, board, draw_text, text_width
from etnet.render.colours import GROUND, sequential

WORDS = "Reconstruction of window 12"


@pytest.mark.parametrize("capital", [10, 14, 21])
def test_a_line_takes_the_width_that_is_told_of_it(capital):
    image = np.zeros((60, 900, 3), np.uint8)
    draw_text(image, WORDS, (10, 40), capital, SOFT)
    columns = np.flatnonzero(image.any((0, 2)))
    assert columns[0] >= 10
    assert abs(columns[-1] - 10 - text_width(WORDS, capital)) <= capital / 3


def test_a_line_that_is_too_long_shrinks_and_one_at_the_border_is_cut_off():
    image = np.zeros((60, 900, 3), np.uint8)
    draw_text(image, WORDS, (10, 40), 21, SOFT, 150)
    assert np.flatnonzero(image.any((0, 2)))[-1] <= 160 + 4
    draw_text(image, WORDS, (880, 3), 21, SOFT)


def test_a_tile_is_shown_whole_at_its_place_and_a_missing_one_is_ground():
    white = np.full((30, 40), 255, np.uint8)
    image = board("title", "facts", [Section([Row([Tile(white), None, Tile(white)])])])
    width = (WIDTH - 2 * MARGIN - 2 * GAP) // 3
    row = image[image.shape[0] - MARGIN - 50]
    assert (row[MARGIN : MARGIN + width] == 255).all()
    assert (row[MARGIN + width + GAP : MARGIN + 2 * width + GAP] == GROUND).all()
    assert (row[MARGIN + 2 * (width + GAP) :][:width] == 255).all()


def test_names_in_any_script_are_no_error():
    scale = Scale(sequential(), "≤ −1", "1 ×")
    tile = Tile(np.zeros((4, 6, 3), np.uint8), "Prüfung · 測試", "½ …")
    assert board("測試", "", [Section([Row([tile], "1/8")], "…", scale)]).shape[1] == WIDTH
