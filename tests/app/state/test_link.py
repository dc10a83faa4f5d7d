"""A moment as one word in an address leads to that moment, and a stranger's word breaks no page."""

import base64
import contextlib
import json
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.state.link import LONGEST, VERSION, LinkError, to_link
from app.state.run import Run
from app.state.view_state import Limits, ViewState
from app.views.attention.state import AttentionState
from app.views.compare.state import CompareState
from app.views.inspect.state import InspectState, Switch
from app.views.scene.state import SceneState
from app.views.voxels.state import VoxelsState
from etnet.events.denoise import Cleaning
from etnet.events.events import Sensor
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration, Window
from tests.app.reducing import from_link, reduce

OPEN = Limits(Sensor(40, 30), [Window(i, i * 10, i * 10 + 10, i * 1000, i * 1000 + 1000) for i in range(30)])
STATE = ViewState(
    recording_id="bundled-prints", model_id="etnet-half", precision="fp32", policy=ByCount(1234), index=7,
    is_playing=True, workspace="attention", query=(12, 3), speed=0.5,
).put(AttentionState(site="scale2.decoder.0.cross", head=3), SceneState(camera="front"))  # fmt: skip


@pytest.mark.parametrize("policy", [BetweenFrames(), ByCount(7), ByDensity(0.35), ByDuration(20_000, 5_000)])
def test_a_link_leads_to_the_same_moment_paused_whatever_was_on_show_before(policy):
    before = ViewState(recording_id="other", speed=0.02, loops=False, staged="voxels").put(VoxelsState(3))
    linked, refused = from_link(to_link(replace(STATE, policy=policy), 5000), before)
    assert refused == ()
    kept = {"loops": False, "staged": "voxels"}
    assert linked == replace(STATE, policy=policy, index=0, moment=5000, is_playing=False, **kept)


def test_a_link_can_stand_in_an_address_as_it_is():
    assert set(to_link(STATE, -5)) <= set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_")


def of(**carried):
    return base64.urlsafe_b64encode(json.dumps(carried).encode()).decode()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("", "cannot be read"),
        ("%%%", "cannot be read"),
        ("ü", "cannot be read"),
        (base64.urlsafe_b64encode(b"[" * 1000).decode(), "cannot be read"),
        ("A" * 5000, "5,000 characters"),
        (to_link(STATE, 5)[:-20], "cannot be read"),
        (of(v=1, t=5, recording_id="a"), "another version"),
        (of(v=VERSION, recording_id="a"), "names no moment"),
        (of(v=VERSION, t="5", recording_id="a"), "names no moment"),
        (of(v=VERSION, t=5), "names no moment"),
    ],
)
def test_what_is_no_link_is_refused_in_words(value, said):
    with pytest.raises(LinkError, match=said):
        from_link(value, STATE)


def test_what_a_link_carries_beyond_reason_is_left_out_and_named():
    views = {"reconstruction": {"tone": "sepia"}, "attention": {"site": "../etc"}, "gone": {}}
    value = of(v=VERSION, t=5, recording_id="a", views=views, is_playing=True, token="x", index=3, visit=9)
    linked, refused = from_link(value, STATE)
    assert set(refused) == {"reconstruction: tone", "attention: site", "gone", "is_playing", "token", "index", "visit"}
    assert (linked.recording_id, linked.slices, linked.is_playing, linked.index) == ("a", (), False, 0)


def test_a_link_carries_runs_but_no_change_of_the_network_nor_leaves_one_that_was_there():
    runs = CompareState(runs=(Run(), Run(precision="bf16", cleaning=Cleaning(hot_pixels=True), cold_from=7)))
    changed = reduce(STATE.put(runs), Switch("scale 3"), OPEN)
    assert changed.of(InspectState) != InspectState()
    value = to_link(changed, 5000)
    linked, refused = from_link(value, changed)
    assert (linked.of(InspectState), linked.of(CompareState), refused) == (InspectState(), runs, ())
    assert len(value) < LONGEST
    assert from_link(to_link(STATE, 5000), changed)[0].of(CompareState) == CompareState()


@given(st.text(max_size=300) | st.binary(max_size=200).map(lambda b: base64.urlsafe_b64encode(b).decode()))
def test_no_word_of_a_stranger_breaks_a_page(value):
    with contextlib.suppress(LinkError):
        from_link(value, STATE)
