"""Where a pixel comes from, since when, and what a change does from there on."""

from dataclasses import replace

import numpy as np
import pytest

from app.engine.jobs import JobResult
from app.engine.network_parts import NetworkPartsJob, network_parts
from app.html.attention.changed import change_words
from app.html.controls import percent
from app.html.moment import Moment
from app.state.view_state import ViewState
from app.views import VIEWS
from app.views.attention.state import AttentionState
from app.views.inspect.html.causes import search_html, sources_html, spread_html
from app.views.inspect.html.on_timeline import change_on_timeline
from app.views.inspect.jobs.causes import BACK, DROP, SEEDS, CauseJob, SourcesJob, SpreadJob, TwinJob
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.jobs.parts import AblatedPartsJob
from app.views.inspect.panel import inspector_html
from app.views.inspect.state import Change, InspectState
from app.views.page import Page
from app.views.timeline.panel import changed_windows, measure_of
from app.views.view import changing_views
from etnet.errors import ModelError
from etnet.events.edit import EventEdit
from etnet.events.recording import GroundTruth
from etnet.inspection import causal_search, sources, twin
from etnet.inspection.follow import follow, pixels_of
from etnet.inspection.rollout import rollout
from etnet.inspection.through_time import Track, attention_through_time
from etnet.nets.attention import AttentionProbe
from etnet.nets.intervention import Intervention
from etnet.nets.presets import UNTRAINED, build_model
from etnet.playback.playback import Playback
from tests.app.checked_html import Checker
from tests.app.small_loaded import POLICY, QUERY, SITE, loaded_of, request_of, whole
from tests.inspection.small import SENSOR

INDEX = 4
ZEROED = Intervention(zeroed_levels=frozenset({1, 2, 3}))
EACH_ZEROED = "state of level 1 zeroed · state of level 2 zeroed · state of level 3 zeroed"


@pytest.fixture(scope="module")
def loaded():
    return loaded_of()


def page_of(loaded, state, ready=None, **results):
    moment = Moment("r", POLICY, state.index, loaded.playback.recording, loaded.playback.windows)
    found = {f"inspect.{name}": JobResult(job, value, 1.0, True) for name, (job, value) in results.items()}
    return Page(replace(state, recording_id="r", model_id="m"), moment, ready, results=found)


def test_where_windows_pass_an_answer_about_one_is_not_said_to_be_under_way(loaded):
    page = page_of(loaded, ViewState(index=INDEX, query=QUERY))
    assert "ablating one part after the other" in inspector_html(page)
    followed = inspector_html(replace(page, follows=True))
    assert "pause (space), or go back" in followed
    assert "ablating one part after the other" not in followed


# ---- what is found ----


def test_the_bars_are_what_the_library_measures_of_the_same_parts(loaded):
    found = whole(AblatedPartsJob(request_of(INDEX)), loaded)
    *_, figure = sources.pixel_sources(loaded.playback, INDEX, QUERY)
    measured = {part.name: part.at_pixel for part in figure.parts}
    x, y = QUERY
    assert found.at("events now", QUERY) == pytest.approx(measured["all events"], abs=1e-6)
    assert found.at("TPA", QUERY) == pytest.approx(measured["TPA"], abs=1e-6)
    assert found.at("skip 0", QUERY) == pytest.approx(measured["skip 0"], abs=1e-6)
    reset = causal_search.reset_once(loaded.playback, INDEX, frozenset({1, 2, 3})).at(INDEX).frame[0, 0, y, x]
    expected = float(reset - loaded.playback.at(INDEX).frame[0, 0, y, x])
    assert found.at("state before", QUERY) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("preset", "names"), [("e2vid", {"events now", "state before"}), ("firenet", {"events now"})])
def test_a_network_has_the_bars_of_the_parts_that_it_has(preset, names):
    found = whole(AblatedPartsJob(request_of(2)), loaded_of(preset))
    assert names <= set(found.differences)
    assert "TPA" not in found.differences


def test_with_a_pixel_and_no_inspector_open_bars_and_the_list_stand_there(loaded):
    job = AblatedPartsJob(request_of(INDEX))
    state = ViewState(index=INDEX, query=QUERY)
    page = Checker(inspector_html(page_of(loaded, state, ablated=(job, whole(job, loaded)))))
    assert len(page.by_testid("moved")) == len(whole(job, loaded).differences)
    assert "Ablation at this pixel" in page.text
    for words in ("Skip, head", "Events now", "State before"):
        assert words in page.text
    assert "set:inspect.opened:search" in page.keys
    assert "Choose a pixel" in inspector_html(page_of(loaded, replace(state, query=None)))


def test_every_source_has_a_line_as_wide_as_what_was_measured(loaded):
    job = SourcesJob(request_of(INDEX), QUERY)
    figure = whole(job, loaded)
    page = Checker(sources_html(figure))
    widths = [float(attrs["stroke-width"]) for attrs in page.by_testid("source")]
    amounts = [abs(part.at_pixel) for part in sorted(figure.parts, key=lambda part: sources.STAGES.index(part.stage))]
    assert len(widths) == figure.num_parts
    assert widths[int(np.argmax(amounts))] == max(widths)


def test_the_search_is_the_librarys_and_offers_its_twin(loaded):
    job = CauseJob(request_of(7), QUERY, 0.001)
    found = whole(job, loaded)
    *_, expected = causal_search.search_cause(loaded.playback, 7, QUERY, tolerance=0.001, furthest=64)
    assert found.search.trials == expected.trials
    moment = Moment("r", POLICY, 7, loaded.playback.recording, loaded.playback.windows)
    page = Checker(search_html(found, True, InspectState(tolerance=1), moment, None, "polarity"))
    if expected.changes_at is not None:
        assert f"inspect:twin:{expected.changes_at}:1,2,3" in page.keys
    assert len(page.by_testid("cause")) == 1


def searched(loaded, **asked):
    """The page's own job of a search that is set so, and its answer."""
    state = ViewState("r", "m", policy=POLICY, index=7, query=QUERY).put(InspectState(opened="search", **asked))
    job = inspect_jobs(state, request_of(7))["inspect.search"]
    return state, job, whole(job, loaded)


@pytest.mark.parametrize(("zeroes", "levels"), [("all", {1, 2, 3}), ("2", {2})])
@pytest.mark.parametrize(("towards", "value"), [("any", None), ("value", 0.8)])
def test_a_search_zeroes_the_levels_and_goes_towards_the_value_that_were_chosen(loaded, zeroes, levels, towards, value):
    state, job, found = searched(loaded, tolerance=1, zeroes=zeroes, towards=towards, wanted=80)
    *_, expected = causal_search.search_cause(
        loaded.playback, 7, QUERY, frozenset(levels), 0.001, towards=value, furthest=64
    )
    assert found.search == expected
    network = NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model)
    page = Checker(inspector_html(page_of(loaded, state, search=(job, found), network=network)))
    assert "set:inspect.zeroes:2" in page.keys
    assert len(page.by_testid("entered")) == (expected.entered_at is not None)
    other = state.put(InspectState(opened="search", tolerance=1, zeroes="3", towards=towards, wanted=80))
    assert not Checker(inspector_html(page_of(loaded, other, search=(job, found), network=network))).by_testid("cause")


def test_a_search_towards_the_camera_takes_its_value_of_the_pixel(loaded):
    with pytest.raises(ModelError, match="no camera frame at this moment"):
        searched(loaded, towards="camera")
    playback = loaded.playback
    frames = np.random.default_rng(3).random((8, SENSOR.height, SENSOR.width), np.float32)
    stamps = np.array([window.t_stop for window in playback.windows], np.int64)
    seen = replace(playback.recording, ground_truth=GroundTruth(stamps, lambda i: frames[i]))
    again = replace(loaded, playback=Playback(playback.model, seen, playback.windows))
    *_, found = searched(again, towards="camera")
    assert found.towards == pytest.approx(float(frames[7][QUERY[1], QUERY[0]]))


@pytest.mark.parametrize("once", [False, True])
@pytest.mark.parametrize(
    "change",
    [
        {"intervention": ZEROED},
        {"edit": EventEdit(drop=0.5, seed=1)},
        {"intervention": Intervention(masked_heads=frozenset({(SITE, 1)}))},  # it changes the decoding alone
    ],
)
def test_a_twin_is_two_runs_in_step(loaded, once, change):
    found = whole(TwinJob(request_of(2, since=2, once=once, **change)), loaded)
    other = twin.changed(loaded.playback, 2, once=once, **change)
    moments = list(twin.twin(loaded.playback, other, range(2, 8)))
    assert found.indices == tuple(range(2, 8))
    for i, moment in enumerate(moments):
        assert np.array_equal(found.original[i], moment.original.numpy())
        assert np.array_equal(found.changed[i], moment.changed.numpy())
    curve = twin.EffectCurve.of(moments, QUERY)
    assert np.allclose(found.at(QUERY), curve.at_pixel.numpy())
    assert found.recovered_at(0.02) == curve.recovered_at(0.02)


def test_the_twin_shows_both_frames_of_the_current_window_and_its_curve_goes_there(loaded):
    change = Change(ZEROED, since=2, once=True)
    state = ViewState(index=INDEX, query=QUERY).put(InspectState(opened="twin", change=change))
    job = inspect_jobs(state, request_of(INDEX))["inspect.twin"]
    page = Checker(inspector_html(page_of(loaded, state, twin=(job, whole(job, loaded)))))
    assert len(page.by_testid("twin-pair")) == 1
    assert any(key.startswith("span:") for key in page.keys)
    assert f"{EACH_ZEROED} · once, in window 2" in page.text
    nothing = state.put(InspectState(opened="twin"))
    network = NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model)
    assert f"inspect:twin:{INDEX}:1,2,3" in Checker(inspector_html(page_of(loaded, nothing, network=network))).keys


def test_a_twin_of_what_holds_in_each_window_by_itself_is_headed_by_what_its_two_runs_are(loaded):
    state = ViewState(index=INDEX, query=QUERY).put(InspectState(opened="twin", change=Change(ZEROED)))
    job = inspect_jobs(state, request_of(INDEX))["inspect.twin"]
    page = Checker(inspector_html(page_of(loaded, state, twin=(job, whole(job, loaded)))))
    assert f"{EACH_ZEROED} · persistent from window {INDEX}" in page.text
    assert "this window only" not in page.text
    for other in (Change(ZEROED, since=INDEX, once=True), Change(ZEROED, since=2)):
        former = page_of(loaded, state.put(InspectState(opened="twin", change=other)), twin=(job, whole(job, loaded)))
        assert not Checker(inspector_html(former)).by_testid("twin-pair")


@pytest.mark.parametrize(("preset", "words"), [("tiny", "Level 1 (1/2)"), ("firenet", "Level 1 ")])
def test_a_level_has_a_resolution_only_in_a_network_whose_levels_differ_in_it(preset, words):
    loaded = loaded_of(preset)
    state, job = (
        ViewState(index=INDEX, query=QUERY).put(InspectState(opened="sources")),
        SourcesJob(request_of(INDEX), QUERY),
    )
    network = NetworkPartsJob(request_of(0)), network_parts(loaded.playback.model)
    page = Checker(inspector_html(page_of(loaded, state, network=network, sources=(job, whole(job, loaded)))))
    assert words in page.text
    assert ("(1/2)" in page.text) == (preset == "tiny")
    frozen = Intervention(zeroed_levels=frozenset({1}), frozen_levels=frozenset({2}))
    assert change_words(frozen, EventEdit()) == "state of level 1 zeroed · state of level 2 frozen"


@pytest.mark.parametrize(
    ("change", "marked"),
    [
        (Change(Intervention(without_context=True), since=2, once=True), range(2, 3)),
        (Change(Intervention(without_context=True), since=2), range(2, 8)),
        (Change(ZEROED, since=2, once=True), range(2, 8)),  # its state carries it on
        (Change(ZEROED), range(INDEX, INDEX + 1)),
    ],
)
def test_the_timeline_marks_the_windows_that_a_change_reaches_and_calls_no_mark_a_measure(loaded, change, marked):
    page = page_of(loaded, ViewState(index=INDEX).put(InspectState(change=change)))
    assert changed_windows(page) == marked
    assert change_on_timeline(page)
    assert measure_of(replace(page, over_timeline=change_on_timeline(page))) == ""


@pytest.mark.parametrize(
    ("preset", "offered"),
    [("tiny", {"1,2,3", "1", "2", "3"}), ("firenet", {"1,2", "1", "2"}), ("leaky-integrator", set())],
)
def test_only_levels_that_the_network_has_are_offered_to_be_zeroed(loaded, preset, offered):
    model = build_model(UNTRAINED.get(preset, preset))
    state = ViewState(index=INDEX, query=QUERY).put(InspectState(opened="twin"))
    page = page_of(loaded, state, network=(NetworkPartsJob(request_of(0)), network_parts(model)))
    keys = Checker(inspector_html(page)).keys
    prefix = f"inspect:twin:{INDEX}:"
    assert {key.removeprefix(prefix) for key in keys if key.startswith(prefix)} == offered


def test_a_change_is_marked_on_the_timeline_in_every_workspace(loaded):
    change = Change(ZEROED, since=2)
    state = ViewState(index=INDEX, workspace="recording").put(InspectState(change=change))
    assert [view.name for view in changing_views(state, VIEWS)] == ["inspect"]
    drawn = Checker(change_on_timeline(page_of(loaded, state)))
    assert "persistent from window 2" in drawn.text
    assert change_on_timeline(page_of(loaded, ViewState())) == ""


@pytest.mark.parametrize("fusion", ["max", "min"])
def test_a_rollout_fuses_heads_as_it_was_asked(loaded, fusion):
    state = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY)
    state = state.put(InspectState(opened="rollout", fusion=fusion))
    job = inspect_jobs(state, request_of(INDEX))["inspect.rolled"]
    attention = loaded.playback.at(INDEX, AttentionProbe()).attention
    expected = rollout(attention, attention.grid.token_at(*QUERY), fusion=fusion)
    assert np.array_equal(whole(job, loaded).weights, expected.weights.numpy())


def test_a_kymograph_stays_on_the_patch_that_is_followed(loaded):
    state = ViewState("r", "m", policy=POLICY, index=INDEX, query=QUERY)
    state = state.put(InspectState(opened="time"), AttentionState(site=SITE, follows=True, anchor=INDEX))
    found = whole(inspect_jobs(state, request_of(INDEX))["inspect.followed"], loaded)
    recording, windows = loaded.playback.recording, loaded.playback.windows
    path = pixels_of(follow(recording, windows, INDEX, QUERY, 0)) | pixels_of(
        follow(recording, windows, INDEX, QUERY, len(windows) - 1)
    )
    assert found.indices == tuple(sorted(path))
    moments = attention_through_time(loaded.playback, path, sorted(path), frozenset({SITE}), head="mean")
    assert np.array_equal(found.entropy, Track.of(moments).entropy[:, 0, 0].numpy())


def test_a_networks_parts_and_what_it_lacks_are_one_answer():
    found = whole(NetworkPartsJob(request_of(0)), loaded_of("e2vid"))
    assert found.lacks == network_parts(build_model("e2vid")).lacks


def test_a_spread_is_the_librarys(loaded):
    from etnet.inspection.uncertainty import dropout_spread

    found = whole(SpreadJob(request_of(3)), loaded)
    *_, expected = dropout_spread(loaded.playback, 3, DROP, SEEDS, BACK)
    assert np.array_equal(found.deviation, expected.deviation.numpy())
    assert (found.num_done, found.pearson) == (SEEDS, None)  # no camera in this recording


def test_a_network_that_estimates_its_variance_is_asked_for_it():
    loaded = loaded_of("pie-net-lite")
    found = whole(SpreadJob(request_of(3)), loaded)
    variance = loaded.playback.at(3).variance[0, 0]
    assert np.allclose(found.own.deviation**2, variance.numpy(), atol=1e-6)
    assert found.own.deviation.shape == found.deviation.shape
    text = spread_html(found, "own", QUERY)
    x, y = QUERY
    assert "own estimate" in text
    assert f"This pixel: {percent(float(found.own.deviation[y, x]), is_signed=False)}. No camera frame" in text
    Checker(text)


def test_a_network_that_estimates_none_is_said_to_have_none(loaded):
    found = whole(SpreadJob(request_of(3)), loaded)
    assert found.own is None
    assert "own estimate" not in spread_html(found, "none", QUERY)


def test_the_networks_own_estimate_is_held_against_the_error():
    loaded = loaded_of("pie-net-lite")
    playback = loaded.playback
    frames = np.random.default_rng(3).random((8, SENSOR.height, SENSOR.width), np.float32)
    stamps = np.array([window.t_stop for window in playback.windows], np.int64)
    seen = replace(playback.recording, ground_truth=GroundTruth(stamps, lambda i: frames[i]))
    again = replace(loaded, playback=Playback(playback.model, seen, playback.windows))
    found = whole(SpreadJob(request_of(3)), again)
    error = np.abs(again.playback.at(3).frame[0, 0].clamp(0, 1).numpy() - frames[3])
    wanted = np.corrcoef(found.own.deviation.ravel(), error.ravel())[0, 1]
    assert found.own.pearson == pytest.approx(wanted, abs=1e-4)
