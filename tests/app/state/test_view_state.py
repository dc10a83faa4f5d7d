"""Whatever is asked, in whatever order, a page stays inside its recording, and its slices stay sound."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.state import intents as ask
from app.state.checks import checked
from app.state.stored import to_text
from app.state.view_state import SHARED_FIELDS, Limits, ViewState
from app.views import VIEWS
from app.views.attention.state import AttentionState, OpenSite
from app.views.compare import state as compare
from app.views.compare.state import CompareState
from app.views.scene.state import ChooseCamera
from app.views.voxels.state import VoxelsState
from etnet.events.denoise import Cleaning
from etnet.events.events import Sensor
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, Window
from tests.app.reducing import from_text, reduce

ANY_FLOAT = st.floats(allow_nan=True, allow_infinity=True)
ANY_INT = st.integers(-(10**12), 10**12)
POLICIES = st.one_of(
    st.just(BetweenFrames()),
    st.builds(ByCount, st.integers(1, 10**6)),
    st.builds(ByDuration, st.integers(1, 10**7), st.none() | st.integers(1, 10**7)),
    st.builds(ByDensity, st.floats(1e-3, 1e3)),
)
HUGE = st.just(10**400) | st.just(-(10**400)) | st.just("\ud800") | st.lists(st.none(), max_size=3)
WORDS = st.sampled_from(
    [
        "none",
        "True",
        "0",
        "3",
        "0.5",
        "wipe",
        "error",
        "ssim",
        "evreal",
        "attends to",
        "per map",
        "cell",
        "time surface",
        "hdr",
    ]
)
ANYTHING = st.none() | st.booleans() | ANY_INT | ANY_FLOAT | st.text(max_size=9) | POLICIES | st.builds(Cleaning) | HUGE
COMPARISONS = st.one_of(
    st.builds(compare.AddRun),
    st.builds(compare.RemoveRun, ANY_INT | st.integers(0, 3)),
    st.builds(
        compare.ChangeRun,
        ANY_INT | st.integers(0, 4),
        st.sampled_from(["model_id", "precision", "policy", "cleaning"]),
        ANYTHING | st.sampled_from(["fp32", "bf16"]),
    ),
    st.builds(compare.StartCold, ANY_INT | st.integers(0, 4), st.booleans()),
)
SETS = st.sampled_from(VIEWS).flatmap(
    lambda view: st.builds(
        ask.Set,
        st.just(view.name),
        st.sampled_from([entry.name for entry in fields(view.initial)] or ["nothing"]) | st.text(max_size=9),
        ANYTHING | WORDS,
        st.booleans(),
    )
)
INTENTS = st.one_of(
    st.builds(ask.OpenRecording, st.text(max_size=20)),
    st.builds(ask.ChooseModel, st.text(max_size=20)),
    st.builds(ask.ChoosePrecision, st.sampled_from(["auto", "fp32", "bf16"])),
    st.builds(ask.ChoosePolicy, POLICIES),
    st.builds(ask.Settle, POLICIES),
    st.builds(ask.Seek, ANY_INT),
    st.builds(ask.SeekTime, ANY_FLOAT),
    st.builds(ask.Move, ANY_INT),
    st.builds(ask.TogglePlay),
    st.builds(ask.PlayTo, ANY_INT),
    st.builds(ask.ChooseSpeed, ANY_FLOAT, st.booleans()),
    st.builds(ask.SetLoop, st.booleans()),
    st.builds(ask.ShowWorkspace, st.sampled_from(["inspect", "attention", "demo", "evil"])),
    st.builds(ask.OpenTab, st.text(max_size=90) | st.just("export")),
    st.builds(ask.StageCard, st.text(max_size=90) | st.just("events")),
    st.builds(ask.Query, ANY_INT, ANY_INT),
    st.builds(ask.QueryFraction, ANY_FLOAT, ANY_FLOAT),
    st.builds(OpenSite, st.text(max_size=30) | st.just("scale2.decoder.0.cross")),
    st.builds(ChooseCamera, st.sampled_from(["orbit", "front", "side", "evil"])),
    COMPARISONS,
    SETS,
)


def limits(num_windows: int = 40, step: int = 1000) -> Limits:
    windows = [Window(i, i * 10, (i + 1) * 10, 5000 + i * step, 5000 + (i + 1) * step) for i in range(num_windows)]
    return Limits(Sensor(64, 48), windows, 5000)


def assert_sound(state):
    """Every field holds what a stranger could have set, and what it says can be shown and sent."""
    for held in (state, *state.slices):
        for entry in fields(held):
            if not entry.metadata.get("passes"):
                value = getattr(held, entry.name)
                assert checked(type(held), entry.name, value) == value
    runs = state.of(CompareState)
    assert len(runs.runs) <= compare.MOST_RUNS
    to_text(state).encode()


@settings(deadline=None)
@given(st.lists(INTENTS, max_size=30), st.integers(1, 50))
def test_no_order_of_intents_leads_out_of_the_recording(asked, num_windows):
    state, bounds = ViewState(), limits(num_windows)
    for intent in asked:
        state = reduce(state, intent, bounds)
        assert 0 <= state.index < num_windows
        assert state.query is None or (0 <= state.query[0] < 64 and 0 <= state.query[1] < 48)
        assert 0 <= state.of(AttentionState).overlay <= 1
        assert_sound(state)
        assert np.isfinite(state.speed)
        assert state.speed > 0


@settings(deadline=None)
@given(st.lists(INTENTS, max_size=20))
def test_a_view_survives_storage_except_that_it_does_not_play_by_itself(asked):
    state, bounds = ViewState(), limits()
    for intent in asked:
        state = reduce(state, intent, bounds)
    restored, refused = from_text(to_text(state), ViewState())
    assert refused == ()
    assert not restored.is_playing
    assert to_text(restored) == to_text(state)


def test_what_is_not_json_gives_the_default():
    assert from_text("{", ViewState(index=3)) == (ViewState(index=3), ("the whole stored view",))
    assert from_text("[1]", ViewState(index=3))[0] == ViewState(index=3)


def test_unknown_and_unsound_values_are_named_and_the_others_kept():
    views = {"reconstruction": {"tone": "sepia"}, "voxels": {"voxel_bin": 2, "colour": 3}, "gone": {}}
    policy = {"kind": "ByCount", "num_events": 0}
    text = json.dumps({"index": 7, "speed": "fast", "is_playing": True, "policy": policy, "views": views})
    state, refused = from_text(text, ViewState())
    assert state == ViewState(index=7).put(VoxelsState(2))
    assert set(refused) == {"speed", "is_playing", "policy", "reconstruction: tone", "voxels: colour", "gone"}


def test_a_number_beyond_its_range_is_brought_to_the_nearer_end():
    state, refused = from_text('{"speed": -1, "views": {"attention": {"overlay": 7}}}', ViewState())
    assert (state.speed, state.of(AttentionState).overlay, refused) == (1e-4, 1.0, ())


def test_every_shared_field_has_a_check_or_passes():
    state = ViewState()
    for entry in fields(ViewState):
        if entry.name in SHARED_FIELDS and not entry.metadata.get("passes"):
            assert checked(ViewState, entry.name, getattr(state, entry.name)) == getattr(state, entry.name)
        else:
            with pytest.raises(ValueError, match="no field"):
                checked(ViewState, entry.name, getattr(state, entry.name))


def test_a_page_keeps_one_slice_a_view_in_order_and_none_that_is_as_it_began():
    state = ViewState().put(VoxelsState(1), AttentionState(head=2)).put(VoxelsState(3))
    assert state.slices == (AttentionState(head=2), VoxelsState(3))
    assert state.put(VoxelsState(), AttentionState()) == ViewState()
    assert state.of(VoxelsState) == VoxelsState(3)
    assert replace(state, slices=()).of(VoxelsState) == VoxelsState()


def test_new_windows_keep_the_moment_in_time():
    coarse, fine = limits(40, 1000), limits(80, 500)
    state = reduce(ViewState(policy=ByCount(10)), ask.Seek(17), coarse)
    state = reduce(state, ask.ChoosePolicy(ByDuration(500)), coarse)
    state = reduce(state, ask.Settle(ByDuration(500)), fine)
    assert fine.windows[state.index].t_stop == coarse.windows[17].t_stop


def test_a_recording_never_looked_at_opens_at_its_first_window_with_events():
    bounds = limits(400)
    assert reduce(ViewState(), ask.Settle(ByCount(10)), bounds).index == 0
    empty = [replace(window, stop=window.start) for window in bounds.windows]
    late = Limits(bounds.sensor, [*empty[:7], *bounds.windows[7:]], bounds.start)
    assert reduce(ViewState(), ask.Settle(ByCount(10)), late).index == 7
    assert reduce(ViewState(), ask.Settle(ByCount(10)), Limits(bounds.sensor, empty, bounds.start)).index == 0
    assert reduce(ViewState(policy=ByCount(10)), ask.Settle(ByCount(10)), late).index == 0
    assert reduce(ViewState(moment=bounds.windows[3].t_stop), ask.Settle(ByCount(10)), late).index == 3


def test_typed_time_finds_the_window_it_was_read_from():
    bounds = limits()
    for index, window in enumerate(bounds.windows):
        seconds = round((window.t_stop - bounds.start) / 1e6, 3)
        assert reduce(ViewState(), ask.SeekTime(seconds), bounds).index == index


@pytest.mark.parametrize("share", [1e307, 1.0, -1e307])
def test_a_fraction_beyond_the_picture_is_its_edge(share):
    state = reduce(ViewState(), ask.QueryFraction(share, share), limits())
    assert state.query == ((63, 47) if share > 0 else (0, 0))


def test_an_index_is_left_alone_while_the_recording_is_not_open():
    assert reduce(ViewState(index=31), ask.SetLoop(False), Limits()).index == 31


def test_playing_past_the_end_loops_or_stops():
    playing = ViewState(index=39, is_playing=True)
    assert reduce(playing, ask.PlayTo(40), limits()) == ViewState(index=0, is_playing=True)
    once = ViewState(index=39, is_playing=True, loops=False)
    assert reduce(once, ask.PlayTo(40), limits()) == ViewState(index=39, is_playing=False, loops=False)


def test_every_seek_of_a_visitor_stops_playing_and_a_late_tick_does_not_move_him():
    playing = ViewState(index=3, is_playing=True)
    for intent in (ask.Seek(9), ask.Move(1), ask.SeekTime(0.01)):
        stopped = reduce(playing, intent, limits())
        assert not stopped.is_playing
        assert reduce(stopped, ask.PlayTo(30), limits()) == stopped


def test_play_at_the_end_starts_over():
    assert reduce(ViewState(index=39), ask.TogglePlay(), limits()) == ViewState(index=0, is_playing=True)


def test_a_run_starts_cold_at_the_window_on_show_and_forgets_it_in_another_recording():
    bounds = limits()
    state = reduce(ViewState(recording_id="a", index=7), compare.AddRun(), bounds)
    state = reduce(state, compare.StartCold(1, True), bounds)
    assert state.of(CompareState).runs[0].cold_from == bounds.windows[7].t_start
    assert reduce(state, compare.StartCold(1, False), bounds).of(CompareState).runs[0].cold_from is None
    assert reduce(state, ask.OpenRecording("b"), bounds).of(CompareState).runs == (compare.Run(),)


def test_three_runs_beside_the_main_one_are_the_most_and_each_can_be_removed():
    state = ViewState()
    for _ in range(5):
        state = reduce(state, compare.AddRun(), limits())
    assert len(state.of(CompareState).runs) == compare.MOST_RUNS
    for _ in range(5):
        state = reduce(state, compare.RemoveRun(1), limits())
    assert state.of(CompareState).runs == ()
