"""The inspector: what is found and how it is told."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.engine.network_parts import NetworkPartsJob, network_parts
from app.engine.requests import Ready
from app.html.attention.changed import change_words
from app.html.attention.links import links_of
from app.html.attention.look import AttentionLook
from app.html.pictures import Tones
from app.state.view_state import ViewState
from app.views.attention.state import AttentionState
from app.views.inspect.html.attribution import traced_html
from app.views.inspect.html.change import change_html
from app.views.inspect.html.importance import attended_html, matters_html
from app.views.inspect.html.network_input import given_html
from app.views.inspect.html.overview import NEEDS
from app.views.inspect.html.rollout import rolled_html
from app.views.inspect.jobs import memory, parts, pixel
from app.views.inspect.panel import inspector_html
from app.views.inspect.scene_cloud import traced_cloud
from app.views.inspect.state import Change, InspectState
from app.views.scene.nodes import arc
from app.views.scene.space import Space
from etnet.events.edit import EventEdit
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from tests.app.checked_html import Checker
from tests.app.small_loaded import QUERY, SITE, loaded_of, request_of, whole
from tests.app.views.inspect.pages import moment_of, page_of
from tests.inspection.small import SENSOR, small_playback


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


@pytest.fixture(scope="module")
def ready(loaded):
    step = loaded.playback.at(5, AttentionProbe())
    return Ready(request_of(5), step.frame[0, 0].numpy(), step.attention, 1.0, True, False, False, loaded.contract, 5)


@pytest.fixture
def moment(loaded):
    return moment_of(loaded)


# ---- what is found ----


def test_what_a_part_is_worth_is_the_frame_without_it_minus_the_frame(loaded):
    found = whole(parts.ImportanceJob(request_of(4)), loaded)
    names = [part.name for part in found]
    assert {"TPA", "attention made uniform", "decoders", "scale 3", "skip 0"} <= set(names)
    original = loaded.playback.at(4).frame
    without = loaded.playback.at(4, intervention=Intervention(without_context=True)).frame
    assert np.array_equal(found[names.index("TPA")].difference, (without - original)[0, 0].numpy())


def test_an_outcome_says_how_far_the_changed_frame_lies_from_the_original(loaded):
    job = parts.OutcomeJob(request_of(4, intervention=Intervention(without_context=True)))
    outcome = whole(job, loaded)
    apart = outcome.changed - outcome.original
    assert outcome.mse == pytest.approx(float((apart**2).mean()), rel=1e-5)
    assert outcome.mse > 0
    assert outcome.lpips is None  # 21 rows are too few for it
    same = torch.rand(1, 1, 40, 40)
    assert parts.perceptual(same, same) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("preset", "sites", "levels"), [("tiny", 9, 3), ("e2vid", 0, 3), ("firenet", 0, 2)])
def test_the_anatomy_is_what_the_network_really_has(preset, sites, levels):
    model = build_model(preset)
    found = network_parts(model).anatomy
    assert (len(found.sites), len(found.levels)) == (sites, levels)
    if sites:
        probed = small_playback(preset).at(0, AttentionProbe()).attention
        assert set(found.sites) == set(probed.sites)
        assert found.num_heads == probed.queries[found.sites[0]].shape[0]


def test_deeper_memory_is_added_one_depth_after_the_other(loaded):
    answers = [answer for answer, _ in memory.MemoryDepthJob(request_of(5)).run(loaded, lambda: False)]
    assert [answer.depths for answer in answers] == [(0,), (0, 1), (0, 1, 2), (0, 1, 2, 4)]
    assert set(np.unique(answers[-1].needed)) <= {-1, 0, 1, 2, 4}
    assert len(answers[-1].mean_absolute) == 4


# ---- how it is told ----


def test_every_part_has_a_row_and_the_verdict_names_what_decides(loaded):
    found = whole(parts.ImportanceJob(request_of(4)), loaded)
    page = Checker(matters_html(found, "key", query=QUERY))
    assert len(page.by_testid("part")) == len(found)
    assert len(page.by_testid("verdict")) == 1
    x, y = QUERY
    most = max(found, key=lambda part: abs(part.difference[y, x]))
    assert f"set:inspect.part:{most.name}" in page.keys


def test_attention_that_changes_nothing_visible_is_said_to_explain_nothing(loaded):
    found = tuple(
        replace(part, difference=part.difference * (1e-6 if part.name in ("TPA", "attention made uniform") else 1))
        for part in whole(parts.ImportanceJob(request_of(4)), loaded)
    )
    assert "attention explains nothing here" in Checker(matters_html(found, "quiet", query=QUERY)).text


def test_what_is_looked_at_stands_beside_what_is_handed_over(loaded, ready):
    attended = whole(parts.AttendedJob(request_of(5)), loaded)
    assert set(attended.sinks) == set(ready.attention.sites)
    page = Checker(attended_html(attended, SITE, AttentionLook(QUERY), "key", base="x"))
    assert "attention" in page.text
    assert "contribution" in page.text
    assert page.text.count("padding ") >= len(ready.attention.sites)


def test_a_switched_button_says_so_by_name_and_everything_can_be_reset(loaded):
    anatomy = network_parts(loaded.playback.model)
    change = Change(
        Intervention(removed_skips=frozenset({1}), masked_heads=frozenset({(SITE, 2)})), EventEdit(drop=0.5)
    )
    html = change_html(anatomy, change, index=4, site=SITE, outcome=None, key=None, tones=Tones(), is_whole=False)
    page = Checker(html)
    pressed = {attrs["data-k"] for _, attrs in page.tags if attrs.get("aria-pressed") == "true"}
    assert {
        "inspect:switch:skip 1",
        f"inspect:switch:head {SITE} 2",
        "inspect:edit:drop:0.5",
        "inspect:scope:window",
    } <= pressed
    assert "inspect:reset" in page.keys
    words = "head 2 of 1/4 decoder 0, cross masked · skip 1/2 removed · 50 % of the events dropped"
    assert change_words(change.intervention, change.edit) == words
    assert f"{words} · this window only" in page.text


@pytest.mark.parametrize(
    ("index", "once", "said"),
    [
        (4, True, "It begins at window 5: here the image is original."),
        (9, True, "It held in window 5 alone: here the image is original."),
        (9, False, "each later window is changed by itself"),
    ],
)
def test_where_a_change_of_the_decoding_holds_is_said_as_it_is(loaded, index, once, said):
    change = Change(Intervention(without_context=True), since=5, once=once)
    told = {"outcome": None, "key": None, "tones": Tones(), "is_whole": False}
    html = change_html(network_parts(loaded.playback.model), change, index=index, site=SITE, **told)
    text = Checker(html).text
    assert said in text
    assert ("It begins" in text) == (index < 5)
    assert ("later windows are as they were" in text) == once


NETWORKS = ("e2vid", "firenet")


@pytest.mark.parametrize("preset", NETWORKS)
def test_what_a_network_has_nothing_for_is_said_in_one_sentence_at_every_inspector(moment, preset):
    network = network_parts(build_model(preset))
    job = NetworkPartsJob(request_of(0))
    for opened, needs in NEEDS.items():
        state = ViewState(query=QUERY).put(InspectState(opened=opened))
        text = Checker(inspector_html(page_of(state, moment, None, network=(job, network)))).text
        if needs in network.lacks:
            assert f"{network.lacks[needs]}." in text
            assert network.anatomy.name in text
        else:
            assert "Nothing to show" not in text
    changed = page_of(ViewState().put(InspectState(opened="change")), moment, None, network=(job, network))
    assert "has no attention" in Checker(inspector_html(changed)).text


def test_somebodys_own_function_is_never_claimed_to_be_anything(moment):
    from etnet.nets.adapter import Adapter

    own = network_parts(Adapter(lambda voxel, memory: (voxel.sum(1, keepdim=True), ()), name="mine"))
    assert own.lacks.keys() >= {"attention", "rollout", "gates", "ablation", "intervention"}
    assert not any("convolution" in said for said in own.lacks.values())


def test_who_reads_a_token_is_its_column_of_the_map(ready):
    from app.html.attention.maps import rows_of

    token = ready.attention.grid.token_at(*QUERY)
    all_rows = ready.attention.rows(SITE, range(ready.attention.grid.num_tokens))
    assert np.allclose(
        rows_of(ready, ready.attention, SITE, QUERY, "attended by"), all_rows[..., token].numpy(), atol=1e-6
    )


def test_the_cloud_holds_the_events_that_the_pixel_owes_most(loaded):
    job = pixel.AttributionJob(request_of(5), QUERY, 2)
    traced = whole(job, loaded)
    assert [window.index for window in traced.windows] == [3, 4, 5]
    cloud = traced_cloud(traced, job, 100)
    assert len(cloud.positions) <= 100
    assert 0 <= cloud.positions[:, 2].min() <= cloud.positions[:, 2].max() <= 1
    strongest = max(traced.windows, key=lambda window: np.abs(window.weights).max())
    place = int(np.abs(strongest.weights).argmax())
    where = (strongest.events.x[place] + 0.5, strongest.events.y[place] + 0.5)
    assert any(np.allclose(spot[:2], where) for spot in cloud.positions)
    assert "within 16 pixels" in Checker(traced_html(traced, job, 2)).text


def test_the_given_tensor_shows_every_event_of_the_pixel_and_its_votes(loaded, moment):
    job = memory.NetworkInputJob(request_of(5))
    given_ = whole(job, loaded)
    assert given_.padded.shape[1:] == (24, 40)
    assert given_.borders == (2, 1, 1, 1)
    bins = [attrs for tag, attrs in Checker(given_html(given_, job, moment, None, False)).tags if tag == "img"]
    assert [attrs["data-area"] for attrs in bins] == ["-1,-2,40,24"] * 5  # of the sensor: its borders lie outside
    events = moment.events
    x, y = int(events.x[10]), int(events.y[10])
    page = Checker(given_html(given_, job, moment, (x, y), False))
    num_here = int(((events.x == x) & (events.y == y)).sum())
    assert sum(tag == "line" for tag, _ in page.tags) == num_here + 1
    votes = given_.padded[:, y + 2, x + 1]
    assert votes.sum() == pytest.approx(events.p[(events.x == x) & (events.y == y)].sum(), abs=1e-5)
    assert f"token {loaded.playback.at(5, AttentionProbe()).attention.grid.token_at(x, y)} of 15" in page.text


@pytest.mark.parametrize("plane", ["hidden", "cell", "enter", "forget", "out", "candidate"])
def test_channels_come_by_energy_in_the_networks_own_numbers(loaded, moment, plane):
    job = memory.ChannelsJob(request_of(5), 2, plane)
    channels = whole(job, loaded)
    assert (np.diff(channels.energy) <= 0).all()
    if plane == "hidden":
        hidden = loaded.playback.state(5).tensors[2][0]
        assert np.array_equal(channels.values[0], hidden[int(channels.order[0])].numpy())
    state = ViewState(query=QUERY).put(InspectState(opened="state", plane=plane, level=2, channel=1))
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment, None, network=anatomy, channels=(job, channels))))
    assert "no. 2 by energy" in page.text


def test_the_memory_of_the_clicked_pixel_is_said(loaded, moment):
    job = memory.MemoryDepthJob(request_of(5))
    found = whole(job, loaded)
    state = ViewState(query=QUERY, index=5).put(InspectState(opened="memory"))
    page = Checker(inspector_html(page_of(state, moment, None, remembered=(job, found))))
    needs = int(found.needed[QUERY[1], QUERY[0]])
    words = {-1: "more than 4 windows", 0: "no window", 1: "1 window"}
    said = f"needs {words.get(needs, f'{needs} windows')} before"
    assert f"Pixel {QUERY} {said}" in page.text


def test_what_is_rolled_out_is_the_librarys_and_sums_to_one(loaded, ready):
    from etnet.inspection.rollout import rollout

    job = pixel.RolloutJob(request_of(5), QUERY, 0.5)
    rolled = whole(job, loaded)
    expected = rollout(ready.attention, ready.attention.grid.token_at(*QUERY), 0.5)
    assert np.allclose(rolled.weights, expected.weights.numpy(), atol=1e-6)
    state = ViewState(query=QUERY, index=5).put(InspectState(opened="rollout", discard=50))
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment_of(loaded), ready, network=anatomy, rolled=(job, rolled))))
    assert "sums to 1.0000" in page.text
    assert len(page.by_testid("by-scale")) == 1


def test_maps_made_of_rows_keep_the_colours_of_rows_whichever_direction_is_chosen(loaded, ready):
    rolled = whole(pixel.RolloutJob(request_of(5), QUERY, 0.5), loaded)
    attended = whole(parts.AttendedJob(request_of(5)), loaded)
    looks = [AttentionLook(QUERY, direction=direction) for direction in ("attends to", "attended by")]
    drawn = {rolled_html(rolled, ready, look, InspectState(), "x") for look in looks}
    assert len(drawn) == 1
    assert "attention received" not in drawn.pop()
    assert len({attended_html(attended, SITE, look, "key", base="x") for look in looks}) == 1


def test_what_is_followed_holds_the_map_of_the_current_window_and_of_the_chosen_head(loaded, ready):
    job = pixel.ThroughTimeJob(request_of(0), QUERY, SITE)
    followed = whole(job, loaded)
    assert followed.indices == tuple(range(8))  # past and coming
    grid = ready.attention.grid
    token = grid.token_at(*QUERY)
    row = ready.attention.rows(SITE, [token])[:, 0]
    mean = row.mean(0).reshape(grid.rows, grid.columns)
    assert np.allclose(followed.along_row[5], mean[token // grid.columns].numpy() * grid.num_tokens, atol=1e-5)
    one = whole(pixel.ThroughTimeJob(request_of(0), QUERY, SITE, 2), loaded)
    own = row[2].reshape(grid.rows, grid.columns)
    assert np.allclose(one.along_row[5], own[token // grid.columns].numpy() * grid.num_tokens, atol=1e-5)
    state = ViewState(query=QUERY, index=5).put(InspectState(opened="time"), AttentionState(site=SITE))
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment_of(loaded), ready, network=anatomy, followed=(job, followed))))
    assert f"now {followed.entropy[5]:.2f} bits" in page.text
    start = loaded.playback.recording.span.start
    goes = [f"goto:{(stamp - start) / 1e6:.6f}" for stamp in followed.stamps]
    assert [key for key in page.keys if key.startswith("goto:")] == goes  # a click on a line goes to its window
    spans = [key for key in page.keys if key.startswith("span:")]
    assert spans == [f"span:{goes[0].removeprefix('goto:')},{goes[-1].removeprefix('goto:')}"] * 2
    now = [attrs["title"] for _, attrs in page.tags if attrs.get("class") == "et-now-line"]
    assert now == ["window 5"]


def test_a_threshold_draws_the_cells_of_a_kymograph_that_hold_most(loaded, ready):
    job = pixel.ThroughTimeJob(request_of(0), QUERY, SITE)
    followed = whole(job, loaded)
    state = ViewState(query=QUERY, index=5).put(InspectState(opened="time"), AttentionState(site=SITE, keep="top 10"))
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment_of(loaded), ready, network=anatomy, followed=(job, followed))))
    share = np.sort(followed.along_row.ravel())[-10:].sum() / followed.along_row.sum()
    assert f"10 tokens hold {100 * share:.0f} % of what is shown" in page.text


def test_what_maps_are_not_is_one_click_from_every_inspector_with_maps(moment):
    for opened, has_maps in (("rollout", True), ("time", True), ("matters", True), ("memory", False)):
        state = ViewState(query=QUERY).put(InspectState(opened=opened))
        assert ("set:inspect.shows_not:True" in Checker(inspector_html(page_of(state, moment, None))).keys) == has_maps
        open_ = ViewState(query=QUERY).put(InspectState(opened=opened, shows_not=True))
        assert len(Checker(inspector_html(page_of(open_, moment, None))).by_testid("not")) == has_maps


def test_links_start_at_the_pixel_and_end_where_the_attention_lands(ready):
    links = links_of(ready, QUERY)
    assert [link.scale for link in links] == sorted((link.scale for link in links), reverse=True)
    space = Space(SENSOR)
    pieces = arc(space, QUERY, links[0].pixel)
    ends = space.place(np.array([[*QUERY, 0], [*links[0].pixel, 0]], np.float32) + np.float32([0.5, 0.5, 0]))
    assert np.allclose(pieces[0, 0, :2], ends[0, :2])
    assert np.allclose(pieces[-1, 1, :2], ends[1, :2], atol=1e-5)
    assert np.array_equal(pieces[1:, 0], pieces[:-1, 1])
    assert (pieces[..., 2] < 0).all()
    assert links_of(None, QUERY) == links_of(ready, None) == ()


def test_the_answer_to_a_former_question_is_not_shown_as_the_answer_to_this_one(loaded, moment):
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    job = parts.OutcomeJob(request_of(5, intervention=Intervention(without_context=True)))
    for removed, is_answer in ((frozenset(), True), (frozenset({1}), False)):
        change = Change(Intervention(without_context=True, removed_skips=removed))
        state = ViewState(index=5).put(InspectState(opened="change", change=change))
        page = page_of(state, moment, None, network=anatomy, outcome=(job, whole(job, loaded)))
        assert len(Checker(inspector_html(page)).by_testid("outcome")) == is_answer


def test_what_was_found_of_a_former_network_is_not_shown_as_this_ones(loaded, moment):
    job = parts.AblatedPartsJob(request_of(5))
    page = page_of(ViewState(index=5, query=QUERY), moment, None, ablated=(job, whole(job, loaded)))
    assert Checker(inspector_html(page)).by_testid("moved")
    for other in (replace(page.state, model_id="other"), replace(page.state, precision="bf16")):
        waiting = Checker(inspector_html(replace(page, state=other)))
        assert not waiting.by_testid("moved")
        assert waiting.by_testid("under-way")


def test_norms_are_those_of_the_states(loaded, moment):
    job = memory.NormsJob(request_of(5))
    norms = whole(job, loaded)
    assert norms.indices == tuple(range(6))
    cell = loaded.playback.state(5).tensors[3]
    assert norms.cell[-1, 1] == pytest.approx(float(cell.square().mean().sqrt()), rel=1e-5)
    anatomy = (NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model))
    state = ViewState(index=5).put(InspectState(opened="state"))
    page = Checker(inspector_html(page_of(state, moment, None, network=anatomy, norms=(job, norms))))
    assert "over the last 6 windows" in page.text
