"""The large map: its numbers, its words, what is changed on it, and the column of settings beside it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkPartsJob, network_parts
from app.html.attention.changed import changed_at
from app.html.attention.keep import kept
from app.html.attention.look import AttentionLook
from app.html.attention.maps import attention_image, level_of, map_ends, map_legend, rows_of, tokens_of
from app.html.controls import percent
from app.html.pictures import Tones
from app.state.view_state import ViewState
from app.views.attention.html.atlas import atlas_html
from app.views.attention.html.code import row_text
from app.views.attention.html.shelf import heads_html, time_html
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import side_html
from app.views.attention.html.stage import stage_html
from app.views.attention.html.tokens import tokens_html
from app.views.attention.jobs.heads import MattersJob
from app.views.attention.jobs.site import SiteJob
from app.views.attention.state import AttentionState, look_in
from app.views.inspect.state import Change, InspectState
from app.views.reconstruction.state import ReconstructionState
from etnet.inspection import entropy, mass, threshold
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from tests.app.checked_html import Checker, map_values
from tests.app.small_loaded import QUERY, SITE, request_of
from tests.app.views.attention.small_page import INDEX, STATE, atlas_text, ready_of


def test_the_large_map_carries_its_numbers_and_a_click_on_it_is_a_pixel(ready, page_of):
    title, note, _, html = stage_html(page_of())
    page = Checker(html)
    assert (title, note) == ("1/4 decoder 0, cross", "mean of 4 heads")
    image = next(attrs for _, attrs in page.tags if "data-etv-values" in attrs)
    grid = ready.attention.grid
    row = rows_of(ready, ready.attention, SITE, QUERY).mean(0) * grid.num_tokens
    assert np.allclose(map_values(html)[0], row, rtol=1e-6)
    assert image["data-k"] == f"cut:{-grid.left},{-grid.top},{8 * grid.columns},{8 * grid.rows}"
    assert (image["width"], image["height"]) == (str(grid.columns), str(grid.rows))


def test_a_title_says_direction_and_scales_and_names_site_and_token(ready, page_of):
    token = ready.attention.grid.token_at(*QUERY)
    html = stage_html(page_of())[3]
    assert "1/8 keys that this 1/4 query attends to" in html
    assert f"{SITE} · {token}" in html
    other = stage_html(page_of(AttentionState(site=SITE, direction="attended by")))[3]
    assert "1/4 queries that attend to this 1/8 key" in other


def test_what_a_cross_attention_reads_is_said_of_it_alone(page_of):
    assert "attends to 1/8 · " in stage_html(page_of())[3]
    assert "attends to 1/4 · " in stage_html(page_of(AttentionState(site="scale2.encoder.0.self")))[3]


def test_the_two_entropies_of_all_heads_have_two_names(ready, page_of):
    token = ready.attention.grid.token_at(*QUERY)
    both = entropy.head_entropies(ready.attention.rows(SITE, [token]))
    html = stage_html(page_of())[3]
    assert f"<b>{float(both.of_mean_map):.2f}</b> (mean map)" in html
    assert f"<b>{float(both.mean_of_heads):.2f}</b> (mean of heads)" in html
    assert "(mean of heads)" not in stage_html(page_of(AttentionState(site=SITE, head=1)))[3]


def test_a_column_has_a_range_of_its_own_and_scale_ends_say_where_they_clip():
    look = AttentionLook(QUERY)
    received = replace(look, direction="attended by")
    row = np.full(15, 1 / 15) * np.linspace(0.5, 3, 15)
    assert level_of(row, received).max() > level_of(row, look).max()
    assert "≥ 32 ×" in map_legend(look)
    assert "≤ 1/4 ×" in map_legend(look)
    assert "≥" not in map_legend(received, 4.0)
    assert "received" in map_legend(received, 4.0)
    assert map_ends(look) == ("1/4 x", "32 x uniform")
    assert map_ends(received) == ("1/4 x", "each map's maximum, rounded up to a power of 2")
    assert map_ends(replace(received, map_range="per map"))[1] == "each map's maximum"


def test_what_is_changed_is_named_on_the_map_that_is_muted(loaded, page_of):
    mask = Intervention(masked_heads=frozenset({(SITE, 2)}))
    changed = ready_of(loaded, request_of(INDEX, intervention=mask))
    page = page_of(ready=changed, state=STATE.put(InspectState(change=Change(mask))))
    assert "head 2 masked" in stage_html(page)[3]
    assert "et-muted" in heads_html(page)[2]
    assert "et-muted" in atlas_text(page)
    assert "head 2 of 1/4 decoder 0, cross masked · this window only" in side_html(page)
    other = page_of(AttentionState(site="scale1.encoder.0.self"), ready=changed)
    assert "masked" not in stage_html(other)[3]


def test_what_is_left_out_of_a_whole_network_is_marked_on_each_map_that_it_reaches():
    scale = Intervention(removed_scales=frozenset({2}), without_context=True)
    assert changed_at(scale, "scale2.encoder.0.self") == "scale removed · TPA ablated"
    assert changed_at(scale, "scale1.encoder.0.self") == "TPA ablated"
    decoders = Intervention(without_decoders=True)
    assert changed_at(decoders, "scale2.decoder.0.cross") == "decoders removed"
    assert changed_at(decoders, "scale2.encoder.0.self") == ""


def test_the_largest_over_heads_is_not_said_to_be_received(page_of):
    for gather, is_received in (("mean", True), ("max", False), ("min", False)):
        slice_ = AttentionState(site=SITE, direction="attended by", gather=gather)
        html = stage_html(page_of(slice_))[3]
        assert ("received " in html.replace("received)", "")) == is_received
        assert ("token by token" in html) == (not is_received)
    assert (
        "received " in stage_html(page_of(AttentionState(site=SITE, direction="attended by", gather="max", head=1)))[3]
    )


def test_what_maps_are_not_is_one_click_from_every_card(page_of):
    page = page_of(AttentionState(site=SITE))
    for html in (
        stage_html(page)[2],
        atlas_html(page)[1],
        heads_html(page)[1],
        tokens_html(page)[2],
        time_html(page)[1],
    ):
        assert "set:attention.over:not" in Checker(html).keys
    assert len(Checker(stage_html(page_of(AttentionState(site=SITE, over="not")))[3]).by_testid("not")) == 1


def test_handed_over_is_the_librarys_norm_as_shares(loaded, ready, page_of):
    page = page_of(AttentionState(site=SITE, weight="value"), [("site", SiteJob(request_of(INDEX), SITE))])
    attention = loaded.playback.at(INDEX, AttentionProbe(values=True)).attention
    token = attention.grid.token_at(*QUERY)
    joint = mass.value_weighted(attention, SITE, [token]).joint[0]
    assert np.allclose(shown_of(page).row(), (joint / joint.sum()).numpy(), atol=1e-6)


@pytest.mark.parametrize("preset", ["e2vid", "firenet"])
def test_a_network_without_attention_says_so_in_every_card(page_of, ready, preset):
    network = network_parts(build_model(preset))
    bare = page_of(ready=replace(ready, attention=None))
    bare = replace(bare, results={"attention.network": JobResult(NetworkPartsJob(request_of(0)), network, 1.0, True)})
    said = f"{network.anatomy.name} has no attention, so there are no maps, heads or tokens to show."
    for html in (stage_html(bare)[3], atlas_text(bare), heads_html(bare)[2], tokens_html(bare)[3], side_html(bare)):
        assert said in Checker(html).text


def test_before_the_maps_are_there_their_progress_is_shown(page_of, ready):
    waiting = page_of(ready=replace(ready, attention=None), step_milliseconds=4321.0)
    page = Checker(stage_html(waiting)[3])
    assert len(page.by_testid("under-way")) == 1
    assert "one decode for the maps of all heads, about 4.32 s" in page.text
    assert "Choose a pixel" in stage_html(page_of(state=replace(STATE, query=None)))[3]
    assert "pixel" in Checker(stage_html(page_of(state=replace(STATE, query=None)))[3]).keys


def test_whether_attention_matters_is_measured_for_pixel_and_image(loaded, page_of):
    jobs = [("matters", MattersJob(request_of(INDEX))), ("site_matters", MattersJob(request_of(INDEX), SITE))]
    page = Checker(side_html(page_of(jobs=jobs)))
    x, y = QUERY
    original = loaded.playback.at(INDEX).frame[0, 0]
    for change in (
        Intervention(uniform_attention=True),
        Intervention(without_context=True),
        Intervention(removed_sites=frozenset({SITE})),
    ):
        apart = loaded.playback.at(INDEX, intervention=change).frame[0, 0] - original
        assert percent(abs(float(apart[y, x])), is_signed=False) in page.text
        assert percent(float(apart.abs().mean()), is_signed=False) in page.text


def test_sinks_and_padding_are_told_in_words(page_of):
    page = Checker(side_html(page_of(jobs=[("site", SiteJob(request_of(INDEX), SITE))])))
    assert len(page.by_testid("waste")) == 1
    assert "falls on padding; uniform attention gives" in page.text


def test_a_switch_that_cannot_act_says_why(page_of):
    from app.views.scene.state import SceneState

    front = STATE.put(SceneState(camera="front"))
    assert "the front view hides them" in side_html(page_of(AttentionState(site=SITE, shows_planes=True), state=front))
    assert "The front view shows nothing behind the image" in side_html(page_of(state=front))
    assert "front view" not in side_html(page_of())
    off = side_html(page_of(state=STATE.put(SceneState(shows_events=False))))
    assert "Events are off in the event cloud, so nothing stands behind the image." in off
    pressed = [
        attrs for _, attrs in Checker(off).tags if attrs.get("data-k", "").startswith("set:attention.shows_planes")
    ]
    assert [attrs["aria-pressed"] for attrs in pressed] == ["false", "false"]
    assert "To mask one head, choose it" in side_html(page_of())
    assert "Mask head 1" in side_html(page_of(AttentionState(site=SITE, head=1)))


def test_looks_follow_the_view_state():
    chosen = AttentionState(head=2, overlay=0.5, map_range="per map", direction="attended by")
    state = ViewState(query=(3, 4)).put(chosen, ReconstructionState("robust"))
    look = look_in(state, False)
    assert (look.query, look.head, look.opacity, look.map_range) == ((3, 4), 2, 0.5, "per map")
    assert look.tones == Tones("robust", False)
    assert look.direction == "attended by"
    assert look_in(ViewState(), True) is None


def test_the_attention_image_is_the_networks_own_row(ready):
    image = attention_image(ready, AttentionLook(QUERY), SITE)
    assert image.shape == (21, 38, 3)
    assert attention_image(ready, AttentionLook(QUERY), "scale9.encoder.0.self") is None


@pytest.mark.parametrize(("keep", "drawn"), [("mass 50", threshold.holding), ("top 10", threshold.strongest)])
def test_a_threshold_draws_the_tokens_of_the_library_alone_and_says_what_they_hold(ready, page_of, keep, drawn):
    shown = shown_of(page_of(AttentionState(site=SITE, keep=keep)))
    row = torch.from_numpy(shown.row().copy())
    expected = (drawn(row, 0.5) if "mass" in keep else drawn(row, 10)).numpy()
    assert np.array_equal(kept(shown.row(), keep), expected)
    pixels = tokens_of(ready.attention, shown.row(), shown.look).reshape(-1, 4)
    assert (pixels[~expected, 3] == 0).all()
    whole_map = tokens_of(ready.attention, shown.row(), replace(shown.look, keep="all")).reshape(-1, 4)
    assert np.array_equal(pixels[expected], whole_map[expected])
    share = 100 * float(row[torch.from_numpy(expected)].sum() / row.sum())
    page = page_of(AttentionState(site=SITE, keep=keep))
    assert f"{expected.sum()} tokens hold {share:.0f} %" in Checker(stage_html(page)[3]).text


def test_the_row_of_the_map_is_the_librarys_text_to_the_last_digit(page_of):
    page = page_of(AttentionState(site=SITE, over="row", head=2))
    shown = shown_of(page)
    assert row_text(shown) == threshold.row_csv(torch.from_numpy(shown.row().copy()), shown.grid)
    weights = [float(line.split(",")[5]) for line in row_text(shown).splitlines()[1:]]
    assert np.array_equal(np.float32(weights), shown.row())
    html = stage_html(page)[3]
    assert row_text(shown).splitlines()[3] in html
    assert 'data-etv-save-text="scale2.decoder.0.cross_head2_token' in html
