"""Maps of attention: every site once, in the network's own numbers, the query marked on each."""

from dataclasses import replace

import numpy as np
import pytest
from app.views.attention.html.grid import attention_html, site_html

from app.engine.requests import Ready
from app.html.attention.look import AttentionLook
from app.html.attention.maps import attention_image
from app.html.moment import PICTURES
from app.html.tones import Tones
from app.state.view_state import ViewState
from app.views.attention.html import grid
from app.views.attention.state import AttentionState, look_in
from app.views.reconstruction.state import ReconstructionState
from tests.app.checked_html import Checker
from tests.app.shown_moment import LOOK


def test_the_attention_grid_has_every_site_once_in_its_row_and_column(ready):
    page = Checker(attention_html(ready, LOOK))
    assert sorted(page.keys) == sorted(f"attention:site:{name}" for name in ready.attention.sites)
    for name in ready.attention.sites:
        assert len(page.by_testid(name)) == 1
    assert page.text.count("reads 1/8 ≈") == 2  # 1/4 reads the coarser scale, 1/8 itself
    assert "reads 1/4 ≈" in page.text
    assert "What pixel (20, 30) attends to" in page.text
    assert "1/4 ×" in page.text
    assert "32 ×" in page.text


def test_the_query_is_marked_on_every_map_at_its_token(ready):
    page = Checker(attention_html(ready, LOOK))
    marks = page.by_testid("query")
    grid = ready.attention.grid
    row, column = divmod(grid.token_at(20, 30), grid.columns)
    assert len(marks) == len(ready.attention.sites)
    assert {m["style"] for m in marks} == {
        f"left:{(column + 0.5) / grid.columns:.2%};top:{(row + 0.5) / grid.rows:.2%}"
    }


def test_a_chosen_site_shows_its_heads_and_the_large_map_in_sensor_pixels(ready):
    name = "scale2.decoder.0.cross"
    title, html = site_html(ready, LOOK, name)
    page = Checker(html)
    heads = ready.attention.queries[name].shape[0]
    assert page.keys == ["pixel", *[f"set:attention.head:{i}" for i in range(heads)]]
    assert "cross-attention: 1/4 reads 1/8" in title
    large = next(attrs for tag, attrs in page.tags if tag == "img" and attrs["data-k"] == "pixel")
    assert (large["width"], large["height"]) == ("50", "37")
    one = Checker(site_html(ready, replace(LOOK, head=1), name)[1])
    assert "set:attention.head:none" in one.keys
    assert "No such site" in site_html(ready, LOOK, "scale9.encoder.0.self")[1]


@pytest.mark.parametrize(
    ("look", "has_attention", "says"),
    [(None, True, "Choose a pixel"), (LOOK, False, "No attention for this window yet")],
)
def test_missing_attention_explains_itself(ready, look, has_attention, says):
    attention = ready.attention if has_attention else None
    other = Ready(ready.request, ready.frame, attention, 1.0, True, False, False, ready.contract, 4)
    assert says in Checker(attention_html(other, look)).text
    assert says in Checker(site_html(other, look, "scale2.decoder.0.cross")[1]).text


def test_the_attention_image_is_the_networks_own_row(ready):
    name = ready.attention.sites[0]
    image = attention_image(ready, LOOK, name)
    assert image.shape == (37, 50, 3)
    assert attention_image(ready, LOOK, "scale9.encoder.0.self") is None


def test_attention_that_tells_little_says_so(ready, monkeypatch):
    says = attention_html(ready, LOOK)
    assert "tells little" in says  # a fresh network reads all places alike
    PICTURES._values.clear()
    monkeypatch.setattr(grid, "_ALIKE", 0.5)
    assert "tells little" not in attention_html(ready, LOOK)


def test_one_head_and_the_mean_differ_in_their_pictures(ready):
    name = ready.attention.sites[0]
    first = AttentionLook((20, 30), head=0)
    rows = ready.attention.rows(name, [ready.attention.grid.token_at(20, 30)])[:, 0].numpy()
    assert not np.allclose(rows[0], rows.mean(0))
    html = [site_html(ready, look, name)[1] for look in (LOOK, first)]
    assert "mean of all heads" in html[0]
    assert "head 1</span>" in html[1]
    assert html[0] != html[1]


def test_looks_follow_the_view_state():
    chosen = AttentionState(head=2, overlay=0.5, map_range="per map", direction="read by")
    state = ViewState(query=(3, 4)).put(chosen, ReconstructionState("robust"))
    look = look_in(state, False)
    assert (look.query, look.head, look.opacity, look.map_range) == ((3, 4), 2, 0.5, "per map")
    assert look.tones == Tones("robust", False)
    assert look.direction == "reads"  # who reads a place is shown of one site alone
    assert look_in(state.put(replace(chosen, opens_heads=True)), False).direction == "read by"
    assert look_in(ViewState(), True) is None
