"""What a visitor asks of the inspector, and what the engine makes of a change."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.engine.engine import Engine
from app.session.channel import parse
from app.state import intents as ask
from app.state.stored import to_text
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.attention.state import AttentionState, PinMap
from app.views.attention.state import hear as hear_attention
from app.views.inspect.jobs.inspect import inspect_jobs
from app.views.inspect.state import (
    NO_CHANGE,
    Change,
    ChooseScope,
    EditEvents,
    InspectState,
    ResetAll,
    ShowOriginal,
    ShowTwin,
    Switch,
    changed_request,
    hear,
    is_switched,
    switched,
)
from etnet.events.cleaning import Cleaning
from etnet.events.edit import EventEdit
from etnet.nets.intervention import ORIGINAL, Intervention
from etnet.nets.presets import build_model
from etnet.playback.playback import Playback
from etnet.windows import plan_windows
from tests.app.fakes import Inbox, Shelf
from tests.app.reducing import from_text, reduce
from tests.app.small_loaded import NONSENSE, PARTS, POLICY, QUERY, SITE, loaded_of, request_of
from tests.inspection.small import small_playback


@pytest.mark.parametrize("part", PARTS)
def test_a_part_that_is_switched_twice_is_as_it_was(part):
    once = switched(ORIGINAL, part)
    assert once != ORIGINAL
    assert is_switched(once, part)
    assert not is_switched(ORIGINAL, part)
    assert switched(once, part) == ORIGINAL


@pytest.mark.parametrize("part", NONSENSE)
def test_a_part_that_does_not_exist_changes_nothing(part):
    assert switched(ORIGINAL, part) == ORIGINAL
    assert not is_switched(ORIGINAL, part)


ASKED = st.one_of(
    st.builds(ask.Set, st.just("inspect"), st.just("opened"), st.sampled_from(["none", "matters", "change", "evil"])),
    st.builds(Switch, st.sampled_from([*PARTS, *NONSENSE])),
    st.builds(EditEvents, st.sampled_from(["drop", "invert", "jitter", "jitter_by", "seed"]), st.floats()),
    st.builds(ChooseScope, st.sampled_from(["window", "on", "once"])),
    st.builds(ShowTwin, st.integers(0, 9), st.just(frozenset({1}))),
    st.builds(ResetAll),
    st.builds(ask.Set, st.just("inspect"), st.sampled_from(["level", "channel", "change", "plane"]), st.text()),
    st.builds(PinMap, st.sampled_from(["a", "b"])),
)


@settings(deadline=None, max_examples=40)
@given(st.lists(ASKED, max_size=20), st.integers(0, 7))
def test_no_order_of_requests_leads_out_of_what_there_is_and_a_reset_undoes_it_all(asked, index):
    state = ViewState(index=index)
    for intent in asked:
        state = reduce(state, intent, Limits())
        assert 1 <= state.of(InspectState).level <= 3
        assert 0 <= state.of(InspectState).change.edit.drop <= 1
    assert reduce(state, ResetAll(), Limits()).of(InspectState).change == NO_CHANGE
    for anew in (ask.OpenRecording("another"), ask.ChooseModel("another"), ask.ChooseCleaning(Cleaning(True))):
        assert reduce(state, anew, Limits()).of(InspectState).change == NO_CHANGE


@settings(deadline=None, max_examples=40)
@given(st.lists(ASKED, max_size=20))
def test_what_is_kept_of_an_inspection_is_how_it_looks_and_not_what_it_changed(asked):
    state = ViewState()
    for intent in asked:
        state = reduce(state, intent, Limits())
    restored, refused = from_text(to_text(state), ViewState())
    assert refused == ()
    assert restored.of(InspectState) == replace(state.of(InspectState), change=NO_CHANGE)
    assert restored.of(AttentionState) == replace(state.of(AttentionState), pin_a=None, pin_b=None, compare="none")


@settings(deadline=None, max_examples=40)
@given(
    st.text(max_size=60)
    | st.builds("{}:{}".format, st.sampled_from(["pin:a", "edit:drop", "set", "switch"]), st.text())
)
def test_a_strange_message_is_understood_or_left_alone_and_never_an_error(text):
    for view in ("inspect", "attention"):
        heard = parse(f"pick|{view}:{text}|0.5|0.5|1", VIEWS)
        assert heard is None or isinstance(reduce(ViewState(), heard, Limits()), ViewState)


def test_a_change_holds_from_its_window_on_and_a_change_of_the_decoding_needs_no_beginning():
    carried = Change(Intervention(zeroed_levels=frozenset({1})), since=4)
    assert carried.at(3) == NO_CHANGE
    assert carried.at(4) == carried.at(7) == carried
    decoding = Change(Intervention(without_context=True), since=4)
    assert decoding.at(9) == replace(decoding, since=None)
    assert Change(edit=EventEdit(jitter_by=99), since=2).at(9) == NO_CHANGE


def test_a_change_that_holds_once_is_carried_on_by_the_memory_alone():
    once = Change(Intervention(zeroed_levels=frozenset({1})), since=4, once=True)
    assert once.at(4) == once.at(9) == once
    assert once.at(3) == NO_CHANGE
    assert once.run_from is None
    decoding = Change(Intervention(without_context=True), since=4, once=True)
    assert decoding.at(4) == Change(Intervention(without_context=True))
    assert decoding.at(5) == NO_CHANGE


def test_while_a_key_is_held_the_page_asks_for_the_original():
    state = ViewState(index=5).put(InspectState(change=Change(Intervention(without_context=True))))
    held = reduce(state, ShowOriginal(True), Limits())
    assert changed_request(held.of(InspectState), request_of(5)) == request_of(5)
    back = reduce(held, ShowOriginal(False), Limits())
    assert changed_request(back.of(InspectState), request_of(5)).intervention.without_context


def test_a_reset_found_by_the_search_opens_its_twin():
    state = reduce(ViewState(index=9), ShowTwin(6, frozenset({2})), Limits())
    inspected = state.of(InspectState)
    assert inspected.opened == "twin"
    assert inspected.change == Change(Intervention(zeroed_levels=frozenset({2})), since=6, once=True)
    assert inspect_jobs(state, request_of(9))["inspect.twin"].request.index == 6


def test_a_button_says_what_it_switches():
    assert hear(f"switch:head {SITE} 3") == Switch(f"head {SITE} 3")
    assert hear("edit:drop:0.5") == EditEvents("drop", 0.5)
    assert (hear("scope:on"), hear("scope:once"), hear("reset")) == (ChooseScope("on"), ChooseScope("once"), ResetAll())
    assert hear("twin:7:1,3") == ShowTwin(7, frozenset({1, 3}))
    assert hear("original:on") == ShowOriginal(True)
    assert hear_attention("pin:a") == PinMap("a")
    assert hear("nonsense") is hear("scope:ever") is hear("twin:x:1") is hear("twin:3:9") is None


def test_what_is_changed_goes_into_every_request_and_nothing_else_of_it():
    change = Change(Intervention(without_context=True), EventEdit(drop=0.5), since=4)
    changed = changed_request(InspectState(change=change), request_of(6))
    assert (changed.intervention, changed.edit, changed.since) == (change.intervention, change.edit, 4)
    assert changed.plain == request_of(6)
    assert changed_request(InspectState(change=change), request_of(3)) == request_of(3)
    assert changed_request(InspectState(), request_of(3)) is not None


def test_nothing_is_asked_of_the_model_while_nothing_is_inspected_and_no_pixel_chosen():
    inspected = InspectState(change=Change(Intervention(without_context=True)))
    assert not inspect_jobs(ViewState().put(inspected), request_of(3))
    state = ViewState(query=QUERY).put(inspected)
    assert set(inspect_jobs(state, request_of(3))) == {"inspect.network", "inspect.ablated"}
    opened = state.put(replace(inspected, opened="matters"))
    assert set(inspect_jobs(opened, request_of(3))) == {"inspect.network", "inspect.matters", "inspect.attended"}


# ---- what the engine makes of a change ----


@pytest.fixture
def engine():
    shelf = Shelf({"r": small_playback().recording}, build_model("tiny"))
    running = Engine(shelf, 64 << 20, threads=1, load=shelf.load, prefetches=False)
    yield running
    running.stop()


def frame_of(engine, request):
    inbox = Inbox()
    engine.request("ada", request, inbox)
    return inbox.ready(request.index)


def test_a_change_that_holds_once_is_the_twin_of_the_library(engine):
    from etnet.inspection.twin import changed

    zeroed = Intervention(zeroed_levels=frozenset({1, 3}))
    made = [frame_of(engine, request_of(index, since=3, once=True, intervention=zeroed)).frame for index in (3, 5)]
    alone = Playback(build_model("tiny"), small_playback().recording, plan_windows(small_playback().recording, POLICY))
    twin = changed(alone, 3, zeroed, once=True)
    for index, frame in zip((3, 5), made, strict=True):
        assert np.array_equal(frame, twin.at(index).frame[0, 0].numpy())
    carried = frame_of(engine, request_of(5, since=3, intervention=zeroed)).frame
    assert not np.array_equal(carried, made[1])


CARRIED = [
    {"intervention": Intervention(zeroed_levels=frozenset({1, 3}))},
    {"intervention": Intervention(frozen_levels=frozenset({2}))},
    {"edit": EventEdit(drop=0.5, invert=0.2, seed=3)},
]


@pytest.mark.parametrize("change", CARRIED, ids=["emptied", "frozen", "edited"])
@pytest.mark.parametrize("since", [None, 3])
def test_a_changed_frame_is_the_one_of_a_playback_that_branches_there_and_the_original_comes_back(
    engine, change, since
):
    before = frame_of(engine, request_of(5))
    changed = frame_of(engine, request_of(5, since=since, **change))
    after = frame_of(engine, request_of(5))
    alone = Playback(build_model("tiny"), small_playback().recording, plan_windows(small_playback().recording, POLICY))
    branch = alone.branch(5 if since is None else since, **change)
    assert np.array_equal(changed.frame, branch.at(5).frame[0, 0].numpy())
    assert not np.array_equal(changed.frame, before.frame)
    assert not changed.is_exact
    assert np.array_equal(before.frame, after.frame)
    assert before.is_exact
    assert after.is_exact


def test_a_branch_takes_its_bytes_from_its_playbacks_share():
    loaded = loaded_of()
    loaded.budget_bytes = 1 << 20
    branch, _ = loaded.playing(request_of(5, edit=EventEdit(drop=0.5)))
    assert loaded.playback.budget_bytes + branch.budget_bytes == loaded.budget_bytes == 1 << 20
    assert loaded.playing(request_of(5, edit=EventEdit(drop=0.5)))[0] is branch
    loaded.playing(request_of(5, edit=EventEdit(drop=0.6)))
    assert loaded.budget_bytes == 1 << 20


def test_a_change_from_a_window_on_does_not_go_over_to_the_windows_that_a_filter_leaves():
    state = ViewState("r", "m", policy=POLICY, index=5).put(
        InspectState(change=Change(CARRIED[0]["intervention"], since=4))
    )
    filtered = reduce(state, ask.ChooseCleaning(Cleaning(True)), Limits())
    assert filtered.of(InspectState).change == NO_CHANGE
