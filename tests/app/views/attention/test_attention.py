"""Maps of attention: every site once, in the network's own numbers, the query marked on each."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkPartsJob, network_parts
from app.engine.requests import FrameRequest, Ready
from app.html.attention.look import AttentionLook
from app.html.attention.maps import attention_image, level_of, map_legend, rows_of
from app.html.moment import Moment
from app.html.tones import Tones
from app.state.view_state import Limits, ViewState
from app.views.attention.html import atlas as atlas_view
from app.views.attention.html.atlas import atlas_html
from app.views.attention.html.shelf import heads_html, time_html, tokens_html
from app.views.attention.html.shown import shown_of
from app.views.attention.html.side import side_html, snippet
from app.views.attention.html.stage import stage_html
from app.views.attention.jobs.heads import BEGUN, AtlasJob, MattersJob
from app.views.attention.jobs.site import BasisJob, SiteJob, TokensJob, tokens_of
from app.views.attention.jobs.time import CurveJob, PinJob
from app.views.attention.state import AttentionState, PinMap, Unpin, look_in, reduce_attention
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from app.views.reconstruction.state import ReconstructionState
from app.views.view import Here
from etnet.errors import Cancelled
from etnet.inspection import entropy, mass, pins, similarity
from etnet.inspection.atlas import masking
from etnet.inspection.basis import fit_basis_to_recording
from etnet.inspection.features import feature_map
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.presets import build_model
from tests.app.checked_html import Checker
from tests.app.small_loaded import POLICY, QUERY, SITE, loaded_of, request_of, whole

INDEX = 5
CHOSEN = AttentionState(site=SITE)
STATE = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY, workspace="attention")


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


@pytest.fixture(scope="module")
def ready(loaded):
    return ready_of(loaded, request_of(INDEX))


def ready_of(loaded, request):
    playback, change = loaded.playing(request)
    step = playback.at(request.index, AttentionProbe(), change)
    frame, contract = step.frame[0, 0].numpy(), loaded.contract
    return Ready(request, frame, step.attention, 1.0, True, False, False, contract, INDEX)


@pytest.fixture
def page_of(loaded, ready):
    def make(slice_=CHOSEN, jobs=(), ready=ready, **more):
        found = {f"attention.{slot}": JobResult(job, whole(job, loaded), 1.0, True) for slot, job in jobs}
        playback = loaded.playback
        moment = Moment("r", POLICY, INDEX, playback.recording, playback.windows)
        more = {"state": STATE, **more}
        state = more.pop("state").put(slice_)
        return Page(state, moment, ready, results=found, areas={}, **more)

    return make


def atlas_text(page):
    return "".join(atlas_html(page))


# ---- the atlas ----


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
    words = f"head 1: {expected:+.4f}".replace("-", "−")
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


# ---- the large map ----


def test_the_large_map_carries_its_numbers_and_a_click_on_it_is_a_pixel(ready, page_of):
    title, note, _, html = stage_html(page_of())
    page = Checker(html)
    assert (title, note) == ("1/4 decoder 1, cross", "mean of 4 heads")
    image = next(attrs for _, attrs in page.tags if "data-etv-values" in attrs)
    grid = ready.attention.grid
    row = rows_of(ready, ready.attention, SITE, QUERY).mean(0) * grid.num_tokens
    assert np.allclose([float(value) for value in image["data-etv-values"].split(" ")], row, rtol=0.006)
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


def test_what_is_changed_is_named_on_the_map_that_is_muted(loaded, page_of):
    mask = Intervention(masked_heads=frozenset({(SITE, 2)}))
    changed = ready_of(loaded, request_of(INDEX, intervention=mask))
    page = page_of(ready=changed, state=STATE.put(InspectState(change=Change(mask))))
    assert "head 2 masked" in stage_html(page)[3]
    assert "et-muted" in heads_html(page)[1]
    assert "et-muted" in atlas_text(page)
    assert "head 2 of 1/4 decoder 1, cross masked · this window only" in side_html(page)
    other = page_of(AttentionState(site="scale1.encoder.0.self"), ready=changed)
    assert "masked" not in stage_html(other)[3]


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
    for html in (stage_html(bare)[3], atlas_text(bare), heads_html(bare)[1], tokens_html(bare)[3], side_html(bare)):
        assert said in Checker(html).text


def test_before_the_maps_are_there_their_progress_is_shown(page_of, ready):
    waiting = page_of(ready=replace(ready, attention=None), step_milliseconds=4321.0)
    page = Checker(stage_html(waiting)[3])
    assert len(page.by_testid("under-way")) == 1
    assert "one decode for the maps of all heads, about 4.32 s" in page.text
    assert "Choose a pixel" in stage_html(page_of(state=replace(STATE, query=None)))[3]
    assert "pixel" in Checker(stage_html(page_of(state=replace(STATE, query=None)))[3]).keys


# ---- the shelf ----


def test_heads_show_their_effect_and_are_chosen_by_a_click(loaded, page_of):
    job = AtlasJob(request_of(INDEX))
    page = Checker(heads_html(page_of(jobs=[("atlas", job)]))[1])
    assert page.keys == [f"set:attention.head:{head}" for head in range(4)]
    table = whole(job, loaded).on_pixel(*QUERY)[whole(job, loaded).sites.index(SITE)]
    for head in range(4):
        assert f"{float(table[head]):+.4f}".replace("-", "−") in page.text


def test_similarity_is_the_librarys_and_one_at_the_token_itself(loaded, page_of):
    job = TokensJob(request_of(INDEX), SITE)
    found = feature_map(loaded.playback, INDEX, tokens_of(SITE))
    values = similarity.cosine_similarity(found, found.at(*QUERY)).numpy()
    assert np.array_equal(whole(job, loaded).similarity(QUERY), values)
    page = Checker(tokens_html(page_of(jobs=[("tokens", job)]))[3])
    shown = next(attrs["data-etv-values"] for _, attrs in page.tags if "data-etv-values" in attrs).split(" ")
    assert float(shown[int(np.argmax(values))]) == 1.0
    assert np.allclose([float(value) for value in shown], values.reshape(-1), atol=0.006)


def test_the_basis_of_colours_is_the_recordings_whatever_was_looked_at(loaded, page_of):
    basis = whole(BasisJob(request_of(0), SITE), loaded)
    expected = fit_basis_to_recording(loaded.playback, tokens_of(SITE))
    assert np.array_equal(basis.directions, expected.directions)
    slice_ = AttentionState(site=SITE, tokens="pca")
    jobs = [("tokens", TokensJob(request_of(INDEX), SITE)), ("basis", BasisJob(request_of(0), SITE))]
    _, note, _, html = tokens_html(page_of(slice_, jobs))
    assert "of the variance" in note
    assert "data-etv-values" in html


@pytest.mark.parametrize("quantity", ["entropy", "mass", "effect"])
@pytest.mark.parametrize("follows", [False, True])
def test_a_curve_is_at_the_current_window_what_the_map_says(loaded, ready, page_of, quantity, follows):
    job = CurveJob(
        request_of(INDEX if follows else 0), QUERY, SITE, quantity, 1 if quantity == "effect" else None, follows
    )
    curve = whole(job, loaded)
    place = curve.indices.index(INDEX)
    assert curve.pixels[place] == QUERY
    assert curve.indices == tuple(sorted(curve.indices))
    token = ready.attention.grid.token_at(*QUERY)
    if quantity == "entropy":
        rows = ready.attention.rows(SITE, [token])
        expected = entropy.map_numbers(rows, ready.attention.grid, [token]).entropy[:, 0].numpy()
        assert np.allclose(curve.values[place], expected, atol=1e-5)
    if quantity == "effect":
        x, y = QUERY
        masked = loaded.playback.at(INDEX, intervention=masking(ORIGINAL, SITE, 1)).frame[0, 0, y, x]
        assert curve.values[place, 0] == pytest.approx(float(masked - loaded.playback.at(INDEX).frame[0, 0, y, x]))
    slice_ = AttentionState(site=SITE, curve=quantity, follows=follows, head=1 if quantity == "effect" else None)
    html = time_html(page_of(slice_, [("curve", job)]))[2]
    times = [(stamp - loaded.playback.recording.span.start) / 1e6 for stamp in (curve.stamps[0], curve.stamps[-1])]
    assert f"span:{times[0]:.6f},{times[1]:.6f}" in Checker(html).keys


# ---- pins ----


def pinned_page(page_of, slice_, jobs=()):
    return page_of(slice_, jobs)


def test_a_pin_keeps_its_moment_network_and_change():
    mask = Intervention(masked_heads=frozenset({(SITE, 2)}))
    here = Here(STATE.put(InspectState(change=Change(mask))), Limits())
    slice_ = reduce_attention(AttentionState(site=SITE, head=3), PinMap("a"), here)
    assert slice_.pin_a.request == FrameRequest("r", "m", STATE.precision, POLICY, INDEX, intervention=mask)
    assert (slice_.pin_a.site, slice_.pin_a.head, slice_.pin_a.query) == (SITE, 3, QUERY)
    assert slice_.compare == "a"
    assert reduce_attention(slice_, Unpin("a"), here).pin_a is None
    assert reduce_attention(slice_, Unpin("a"), here).compare == "none"
    nowhere = Here(replace(STATE, query=None), Limits())
    assert reduce_attention(AttentionState(), PinMap("a"), nowhere) == AttentionState()


def test_a_minus_b_is_the_signed_log_ratio_with_both_frames_below(loaded, page_of):
    then = Here(replace(STATE, index=2), Limits())
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("a"), then)
    html = stage_html(page_of(slice_, [("pin", PinJob(slice_.pin_a))]))[3]
    page = Checker(html)
    pair = [pins.pin(loaded.playback, index, QUERY, SITE, "mean") for index in (INDEX, 2)]
    expected = pins.difference(*pair).log_ratio
    shown = next(attrs for _, attrs in page.tags if "data-etv-values" in attrs)
    assert np.allclose([float(v) for v in shown["data-etv-values"].split(" ")], expected.numpy(), atol=0.006)
    assert len(page.by_testid("a-minus-b")) == 1
    assert "window 2" in page.text
    assert "window 5" in page.text
    assert html.count("et-frames-below") == 1
    assert "then ≥" in side_html(page_of(slice_, [("pin", PinJob(slice_.pin_a))]))


def test_a_map_pinned_now_differs_from_itself_by_nothing(page_of):
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("b"), Here(STATE, Limits()))
    html = stage_html(page_of(slice_, [("pin", PinJob(slice_.pin_b))]))[3]
    assert "now and B share 100 % of their weight" in html
    values = re.search('data-etv-values="([^"]+)"', html).group(1).split(" ")
    assert all(abs(float(value)) < 1e-4 for value in values)


# ---- the column ----


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
        assert f"{abs(float(apart[y, x])):.4f}" in page.text
        assert f"{float(apart.abs().mean()):.4f}" in page.text


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


def test_lines_of_python_are_offered_for_the_map_and_for_a_difference(page_of):
    page = replace(page_of(AttentionState(site=SITE, shows_code=True)), file_name="made up.txt")
    assert "array = entropy.choose_head(attention.rows" in Checker(side_html(page)).text
    slice_ = reduce_attention(AttentionState(site=SITE), PinMap("a"), Here(STATE, Limits()))
    both = replace(page_of(slice_, [("pin", PinJob(slice_.pin_a))]), file_name="made up.txt")
    assert "pins.difference" in snippet(shown_of(both))
