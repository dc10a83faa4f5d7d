"""All sites and heads at a glance: every site once, in the network's own numbers, the query marked on each."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.state.view_state import Limits
from app.views.attention.html import atlas as atlas_view
from app.views.attention.html.atlas import atlas_html, effect_words
from app.views.attention.html.shelf import heads_html
from app.views.attention.jobs.heads import BEGUN, AtlasJob
from app.views.attention.state import AttentionState, OpenHead, hear, reduce_attention
from app.views.view import Here
from etnet.errors import Cancelled
from etnet.inspection import atlas as atlas_library
from etnet.inspection import entropy
from etnet.inspection.atlas import masking
from etnet.nets.intervention import ORIGINAL
from tests.app.checked_html import Checker
from tests.app.small_loaded import QUERY, SITE, request_of, whole
from tests.app.views.attention.small_page import INDEX, STATE, atlas_text


def test_the_atlas_has_every_site_once_and_chooses_it(ready, page_of):
    page = Checker(atlas_text(page_of()))
    sites = [key for key in page.keys if key.startswith("attention:site:")]
    assert sorted(sites) == sorted(f"attention:site:{name}" for name in ready.attention.sites)
    for name in ready.attention.sites:
        assert len(page.by_testid(name)) == 1
    chosen = [attrs["data-etv-site"] for _, attrs in page.tags if "et-chosen" in attrs.get("class", "")]
    assert chosen == [SITE]


def test_the_query_is_marked_on_every_map_at_its_token(ready, page_of):
    marks = Checker(atlas_text(page_of())).by_testid("query")
    grid = ready.attention.grid
    row, column = divmod(grid.token_at(*QUERY), grid.columns)
    assert len(marks) == len(ready.attention.sites)
    assert {m["style"] for m in marks} == {f"--u:{(column + 0.5) / grid.columns:.4f};--v:{(row + 0.5) / grid.rows:.4f}"}


def test_a_bar_of_the_atlas_is_the_decode_under_that_mask(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    found = whole(job, loaded)
    original = loaded.playback.at(INDEX).frame
    masked = loaded.playback.at(INDEX, intervention=masking(ORIGINAL, SITE, 1)).frame
    x, y = QUERY
    expected = float((masked - original)[0, 0, y, x])
    assert float(found.on_pixel(x, y)[found.sites.index(SITE), 1]) == expected
    page = Checker(atlas_text(page_of(jobs=[("atlas", job)])))
    words = f"head 1: {effect_words(expected)}"
    said = {attrs["data-etv-site"]: i for i, (_, attrs) in enumerate(page.tags) if "data-etv-site" in attrs}
    bars = next(attrs for _, attrs in page.tags[said[SITE] :] if attrs.get("class") == "et-effects")
    assert words in bars["title"]


def test_an_atlas_that_is_left_goes_on_where_it_was(loaded):
    job = AtlasJob(request_of(2))
    calls = []

    def gives_way():
        calls.append(None)
        return len(calls) > 6

    with pytest.raises(Cancelled):
        list(job.run(loaded, gives_way))
    begun = BEGUN.find(job).progress[0]
    assert begun > 0
    first, _ = next(iter(job.run(loaded, lambda: False)))
    assert first.progress[0] == begun


def test_heads_not_measured_yet_are_told_from_heads_without_effect(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    some = next(answer for answer, _ in job.run(loaded, lambda: False))
    part = replace(whole(job, loaded), differences=some.differences[:3])
    page = page_of()
    page = replace(page, results={"attention.atlas": JobResult(job, part, 0.1)})
    html = atlas_text(page)
    assert html.count('<i class="et-unknown">') == part.progress[1] - len(part.differences)
    assert f"{part.progress[0]} of {part.progress[1]}" in Checker(html).text


@pytest.mark.parametrize("order", ["effect", "image", "entropy", "distance"])
def test_heads_of_a_part_are_sorted_by_their_own_numbers(loaded, ready, page_of, order):
    job = AtlasJob(request_of(INDEX))
    page = Checker(atlas_text(page_of(AttentionState(site=SITE, order=order, only="scale2"), [("atlas", job)])))
    shown = [key.split(":")[2:] for key in page.keys if key.startswith("attention:head:")]
    sites = [name for name in ready.attention.sites if name.startswith("scale2.")]
    found, token = whole(job, loaded), ready.attention.grid.token_at(*QUERY)
    table = atlas_library.head_table(ready.attention, token)
    values = {
        "effect": -found.on_pixel(*QUERY).abs(),
        "image": -found.on_image,
        "entropy": table.entropy,
        "distance": -table.distance,
    }[order]
    assert len(shown) == len(sites) * 4
    ranks = [float(values[table.sites.index(site), int(head)]) for site, head in shown]
    assert np.all(np.diff(ranks) >= -1e-4)


def test_the_effect_on_the_image_has_bars_numbers_and_an_order(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    page = page_of(AttentionState(site=SITE, order="image"), [("atlas", job)])
    found = whole(job, loaded)
    text = Checker(heads_html(page)[2]).text
    for head in range(4):
        assert effect_words(float(found.on_image[found.sites.index(SITE), head])) in text
    first = next(attrs["data-etv-site"] for _, attrs in Checker(atlas_text(page)).tags if "data-etv-site" in attrs)
    assert first == found.sites[int(found.on_image.amax(1).argmax())]
    assert "on the image" in atlas_html(page)[0]


def test_maps_that_explain_little_are_said_to(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    found = whole(job, loaded)
    nothing, everywhere = found.uniform * 0, found.uniform * 0 + 0.1
    here = nothing.clone()
    here[QUERY[1], QUERY[0]] = 0.02  # this pixel rests on it, though the image does not
    for uniform, is_said in ((nothing, True), (everywhere, False), (here, False)):
        result = JobResult(job, replace(found, uniform=uniform), 1.0, True)
        text = atlas_text(replace(page_of(), results={"attention.atlas": result}))
        assert ("maps explain little here" in text) == is_said


@pytest.mark.parametrize("order", ["effect", "entropy", "distance"])
def test_sites_are_sorted_by_what_was_asked_for(loaded, ready, page_of, order):
    job = AtlasJob(request_of(INDEX))
    page = page_of(AttentionState(site=SITE, order=order), [("atlas", job)])
    first = next(attrs["data-etv-site"] for _, attrs in Checker(atlas_text(page)).tags if "data-etv-site" in attrs)
    token, attention = ready.attention.grid.token_at(*QUERY), ready.attention
    if order == "effect":
        table = whole(job, loaded).on_pixel(*QUERY).abs().amax(1)
        best = whole(job, loaded).sites[int(table.argmax())]
    else:
        of = {}
        for site in attention.sites:
            rows = attention.rows(site, [token]).mean(0)[None]
            numbers = entropy.map_numbers(rows, attention.grid, [token])
            of[site] = float(numbers.entropy) if order == "entropy" else -float(numbers.distance)
        best = min(of, key=of.get)
    assert first == best


def test_attention_that_tells_little_says_so(page_of, monkeypatch):
    assert "tells little" in atlas_text(page_of())  # a fresh network attends to all tokens alike
    monkeypatch.setattr(atlas_view, "_ALIKE", 0.5)
    assert "tells little" not in atlas_text(page_of())


def test_heads_show_their_effect_and_are_chosen_by_a_click(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    page = Checker(heads_html(page_of(jobs=[("atlas", job)]))[2])
    assert page.keys == [f"set:attention.head:{head}" for head in range(4)]
    table = whole(job, loaded).on_pixel(*QUERY)[whole(job, loaded).sites.index(SITE)]
    for head in range(4):
        assert effect_words(float(table[head])) in page.text


def test_one_scale_or_column_shows_its_heads_one_by_one_with_their_effects(loaded, ready, page_of):
    job = AtlasJob(request_of(INDEX))
    effects = dict(zip(whole(job, loaded).sites, whole(job, loaded).on_pixel(*QUERY), strict=True))
    for only, part in (("scale2", "scale2."), ("decoder.0.cross", ".decoder.0.cross")):
        page = Checker(atlas_text(page_of(AttentionState(site=SITE, only=only), [("atlas", job)])))
        sites = [name for name in ready.attention.sites if part in name]
        keys = [f"attention:head:{site}:{head}" for head in range(4) for site in sites]
        assert [key for key in page.keys if key.startswith("attention:head:")] == keys
        assert "set:attention.only:" in page.keys  # the way back
        for site in sites:
            assert effect_words(float(effects[site][3])) in page.text


def test_every_head_is_a_dot_at_its_entropy_and_distance_as_large_as_its_effect(loaded, ready, page_of):
    job = AtlasJob(request_of(INDEX))
    page = atlas_text(page_of(AttentionState(site=SITE, shows_dots=True), [("atlas", job)]))
    table = atlas_library.head_table(ready.attention, ready.attention.grid.token_at(*QUERY))
    found = {
        (site, int(head)): (float(bits), tuple(map(float, radii)))
        for site, head, bits, *radii in re.findall(
            r"<title>([\w.]+), head (\d): ([\d.]+) bits.*?r=\"([\d.]+)\".*?r=\"([\d.]+)\"", page
        )
    }
    assert set(found) == {(site, head) for site in ready.attention.sites for head in range(4)}
    for place, site in enumerate(table.sites):
        for head in range(4):
            assert found[site, head][0] == pytest.approx(float(table.entropy[place, head]), abs=0.006)
    strongest = atlas_library.strongest_heads(whole(job, loaded).on_pixel(*QUERY), whole(job, loaded).sites)
    by_size = sorted(found, key=lambda each: -found[each][1][1])
    assert by_size[0] == strongest[0][:2]


def test_a_click_on_a_head_opens_it_at_its_site():
    here = Here(STATE, Limits())
    assert hear(f"head:{SITE}:3") == OpenHead(SITE, 3)
    opened = reduce_attention(AttentionState(), OpenHead(SITE, 3), here)
    assert (opened.site, opened.head) == (SITE, 3)
    for nonsense in ("head:", f"head:{SITE}:x", f"head:{SITE}:123456"):
        assert hear(nonsense) is None
    assert reduce_attention(AttentionState(), OpenHead("nowhere", 2), here).site == AttentionState().site
