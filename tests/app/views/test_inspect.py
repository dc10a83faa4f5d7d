"""The inspector: what is found and how it is told."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from app.engine.jobs import JobResult
from app.engine.requests import Ready
from app.html.attention.links import links_of
from app.html.attention.look import AttentionLook
from app.html.moment import Moment
from app.html.tones import Tones
from app.state.view_state import ViewState
from app.views.attention.html.grid import attention_html, site_html
from app.views.attention.html.tools import attention_tools_html, pinned_html
from app.views.attention.state import AttentionState, PinMap, PinnedMap
from app.views.attention.state import hear as hear_attention
from app.views.inspect.html.attribution import traced_html
from app.views.inspect.html.change import change_html, change_words
from app.views.inspect.html.importance import attended_html, matters_html
from app.views.inspect.html.network_input import given_html
from app.views.inspect.jobs import memory, parts, pixel
from app.views.inspect.panel import inspector_html
from app.views.inspect.scene_cloud import traced_cloud
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from app.views.scene.links import arc
from app.views.scene.space import Space
from etnet.events.edit import EventEdit
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.presets import build_model
from tests.app.checked_html import Checker
from tests.app.small_loaded import POLICY, QUERY, SITE, loaded_of, request_of, whole
from tests.inspection.small import SENSOR, small_playback


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


@pytest.fixture(scope="module")
def ready(loaded):
    step = loaded.playback.at(5, AttentionProbe())
    return Ready(request_of(5), step.frame[0, 0].numpy(), step.attention, 1.0, True, False, False, loaded.contract, 5)


def moment_of(loaded):
    return Moment("r", POLICY, 5, loaded.playback.recording, loaded.playback.windows)


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


@pytest.mark.parametrize(("preset", "sites", "levels"), [("tiny", 9, 3), ("e2vid", 0, 3), ("firenet", 0, 0)])
def test_the_anatomy_is_what_the_network_really_has(preset, sites, levels):
    model = build_model(preset)
    found = parts.anatomy(model)
    assert (len(found.sites), found.num_levels) == (sites, levels)
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


def page_of(state, moment, ready, **results):
    found = {f"inspect.{name}": JobResult(job, value, 1.0, True) for name, (job, value) in results.items()}
    return Page(state, moment, ready, results=found)


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
    assert "looked at" in page.text
    assert "handed over" in page.text
    assert page.text.count("padding ") >= len(ready.attention.sites)


def test_a_switched_button_says_so_and_everything_can_be_put_back(loaded):
    anatomy = parts.anatomy(loaded.playback.model)
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
        "inspect:carry:off",
    } <= pressed
    assert "inspect:reset" in page.keys
    assert change_words(change) == "no skip 1/2 · 1 × head muted · 50 % of the events left out"


def test_a_network_without_attention_or_memory_says_so(moment):
    firenet = parts.anatomy(build_model("firenet"))
    job = parts.PartsJob(request_of(0))
    for opened, words in (("change", "has no attention"), ("state", "no ConvLSTM")):
        state = ViewState().put(InspectState(opened=opened))
        assert words in Checker(inspector_html(page_of(state, moment, None, anatomy=(job, firenet)))).text
    nothing = page_of(ViewState().put(InspectState(opened="matters")), moment, None, matters=(job, None))
    assert "Nothing to take away" in Checker(inspector_html(nothing)).text


def test_a_map_pinned_twice_differs_from_itself_by_nothing(ready):
    pinned = PinnedMap(SITE, None, "mean", QUERY)
    view = AttentionState(pin_a=pinned, pin_b=pinned)
    page = Checker(pinned_html(ready, AttentionLook(QUERY), view))
    assert "A and B share 100 % of their weight." in page.text
    other = replace(view, pin_b=replace(pinned, site="scale1.encoder.0.self", head=1))
    assert len(page.by_testid("a-minus-b")) == 1
    assert "head 2" in Checker(pinned_html(ready, AttentionLook(QUERY), other)).text
    assert pinned_html(ready, AttentionLook(QUERY), AttentionState()) == ""


def test_the_tools_pin_the_map_that_is_opened(ready):
    look = AttentionLook(QUERY, head=2)
    page = Checker(attention_tools_html(AttentionState(), Intervention(), look, site=SITE))
    pinned = next(key for key in page.keys if key.startswith("attention:pin:a:"))
    assert hear_attention(pinned.removeprefix("attention:")) == PinMap("a", PinnedMap(SITE, 2, "mean", QUERY))


def test_heads_are_sorted_by_what_was_asked_for(ready):
    from etnet.inspection.entropy import map_numbers

    token = ready.attention.grid.token_at(*QUERY)
    numbers = map_numbers(ready.attention.rows(SITE, [token]), ready.attention.grid, [token])
    for order, best in (("entropy", numbers.entropy.argmin()), ("distance", numbers.distance.argmax())):
        look = AttentionLook(QUERY, order=order)
        heads = [key for key in Checker(site_html(ready, look, SITE)[1]).keys if key.startswith("set:attention.head:")]
        assert heads[0] == f"set:attention.head:{int(best)}"
        assert len(Checker(attention_html(ready, look)).keys) == len(ready.attention.sites)


def test_who_reads_a_token_is_its_column_of_the_map(ready):
    from app.html.attention.maps import rows_of

    token = ready.attention.grid.token_at(*QUERY)
    all_rows = ready.attention.rows(SITE, range(ready.attention.grid.num_tokens))
    assert np.allclose(rows_of(ready, ready.attention, SITE, QUERY, "read by"), all_rows[..., token].numpy(), atol=1e-6)


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
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment, None, anatomy=anatomy, channels=(job, channels))))
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
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment_of(loaded), ready, anatomy=anatomy, rolled=(job, rolled))))
    assert "sums to 1.0000" in page.text
    assert len(page.by_testid("by-scale")) == 1


def test_what_is_followed_ends_in_the_map_of_the_window_on_show(loaded, ready):
    job = pixel.ThroughTimeJob(request_of(5), QUERY, SITE)
    followed = whole(job, loaded)
    assert followed.indices == tuple(range(6))
    grid = ready.attention.grid
    token = grid.token_at(*QUERY)
    row = ready.attention.rows(SITE, [token])[:, 0].mean(0).reshape(grid.rows, grid.columns)
    assert np.allclose(followed.along_row[-1], row[token // grid.columns].numpy() * grid.num_tokens, atol=1e-5)
    state = ViewState(query=QUERY, index=5).put(InspectState(opened="time"), AttentionState(site=SITE))
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(loaded.playback.model))
    page = Checker(inspector_html(page_of(state, moment_of(loaded), ready, anatomy=anatomy, followed=(job, followed))))
    assert f"now {followed.entropy[-1]:.2f} bits" in page.text


@pytest.mark.parametrize("opened", ["rollout", "time"])
def test_paths_of_attention_say_so_where_there_is_none(moment, opened):
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(build_model("e2vid")))
    state = ViewState(query=QUERY).put(InspectState(opened=opened))
    assert "made of convolutions alone" in Checker(inspector_html(page_of(state, moment, None, anatomy=anatomy))).text


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
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(loaded.playback.model))
    job = parts.OutcomeJob(request_of(5, intervention=Intervention(without_context=True)))
    for removed, is_answer in ((frozenset(), True), (frozenset({1}), False)):
        change = Change(Intervention(without_context=True, removed_skips=removed))
        state = ViewState(index=5).put(InspectState(opened="change", change=change))
        page = page_of(state, moment, None, anatomy=anatomy, outcome=(job, whole(job, loaded)))
        assert len(Checker(inspector_html(page)).by_testid("outcome")) == is_answer


def test_norms_are_those_of_the_states(loaded, moment):
    job = memory.NormsJob(request_of(5))
    norms = whole(job, loaded)
    assert norms.indices == tuple(range(6))
    cell = loaded.playback.state(5).tensors[3]
    assert norms.cell[-1, 1] == pytest.approx(float(cell.square().mean().sqrt()), rel=1e-5)
    anatomy = (parts.PartsJob(request_of(0)), parts.anatomy(loaded.playback.model))
    state = ViewState(index=5).put(InspectState(opened="state"))
    page = Checker(inspector_html(page_of(state, moment, None, anatomy=anatomy, norms=(job, norms))))
    assert "in the last 6 windows" in page.text
