"""What a page, a link or a browser's storage says is a stranger's word: it is sound, or refused by name."""

import base64
import json
from contextlib import suppress
from dataclasses import fields

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.session.channel import parse
from app.state import intents as ask
from app.state.checks import DEEPEST_JSON, bounded_json, checked
from app.state.link import VERSION, LinkError
from app.state.stored import to_text
from app.state.view_state import SHARED_FIELDS, Limits, ViewState
from app.views import VIEWS
from app.views.compare.state import MOST_RUNS, NAMES, AddRun, CompareState
from app.views.inspect.state import NO_CHANGE, InspectState
from etnet.events.denoise import Cleaning
from etnet.nets.intervention import Intervention
from etnet.windows import ByCount, ByDensity, ByDuration
from tests.app.reducing import from_link, from_text, reduce

VIEW_FIELDS = [(view.name, entry.name) for view in VIEWS for entry in fields(view.initial)]
WORDS = (
    "none", "True", "False", "0", "3", "-1", "0.5", "1e999", "nan", "9" * 5000, "runs", "wipe", "error", "ssim",
    "evreal", "attended by", "per map", "entropy", "cell", "time surface", "hdr", "front", "a",
    "scale2.decoder.0.cross", "scale9.decoder.0.cross", "ByCount", "fp32", "auto", "demo", "\ud800", "<b>",
)  # fmt: skip
NUMBERS = st.integers(-4, 70) | st.integers() | st.floats() | st.sampled_from([10**400, -(10**400), 1e308, 2**63])
PLAIN = st.none() | st.booleans() | NUMBERS | st.sampled_from(WORDS) | st.text(max_size=5)
JSON = st.recursive(
    PLAIN,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["kind", "num_events", "duration", "policy", "model_id"]) | st.text(), inner)
    ),
    max_leaves=6,
)
VALUES = st.builds(ByCount, st.integers(1, 9)) | st.builds(Cleaning) | st.builds(Intervention) | st.builds(object)


def assert_sound(state):
    """Each field holds a value that its own check lets through unchanged, and all of it can be written and sent."""
    for held in (state, *state.slices):
        for entry in fields(held):
            if not entry.metadata.get("passes"):
                value = getattr(held, entry.name)
                assert checked(type(held), entry.name, value) == value
    json.loads(to_text(state).encode())
    for name in ("recording_id", "model_id", "tab", "staged"):
        getattr(state, name).encode()


def assert_drawn(state):
    """What panels rely on without asking, from the next intent on."""
    runs = reduce(state, ask.FormChanged(), Limits()).of(CompareState)
    assert len(runs.runs) <= MOST_RUNS
    assert runs.camera == "frame" or NAMES.index(runs.camera) <= len(runs.runs)


@pytest.mark.parametrize(("view", "field"), VIEW_FIELDS)
@settings(deadline=None, max_examples=25)
@given(value=JSON | VALUES, is_word=st.booleans(), has_runs=st.booleans())
def test_whatever_a_field_is_set_to_its_slice_stays_sound(view, field, value, is_word, has_runs):
    before = reduce(ViewState(), AddRun(), Limits()) if has_runs else ViewState()
    state = reduce(before, ask.Set(view, field, value, is_word), Limits())
    assert_sound(state)
    assert len(state.of(CompareState).runs) <= MOST_RUNS
    assert state.of(InspectState).change == NO_CHANGE


AWKWARD = (
    10**400,
    -(10**400),
    float("nan"),
    float("inf"),
    2**63,
    "\ud800",
    "x" * 10_000,
    [[]],
    {"kind": []},
    {1: 2},
    b"",
)


@pytest.mark.parametrize("value", AWKWARD, ids=lambda value: str(type(value).__name__))
def test_no_value_breaks_a_field_however_awkward(value):
    for view, field in VIEW_FIELDS:
        for is_word in (False, True):
            assert_sound(reduce(ViewState(), ask.Set(view, field, value, is_word), Limits()))
    for field in SHARED_FIELDS:
        with suppress(ValueError):
            assert_sound(ViewState(**{field: checked(ViewState, field, value)}))


@settings(deadline=None)
@given(st.text(max_size=9), st.text(max_size=9), JSON, st.booleans())
def test_a_view_or_a_field_that_does_not_exist_sets_nothing(view, field, value, is_word):
    assert reduce(ViewState(), ask.Set(view, f"{field}?", value, is_word), Limits()) == ViewState()
    assert reduce(ViewState(), ask.Set(f"{view}?", field, value, is_word), Limits()) == ViewState()
    assert reduce(ViewState(), ask.Set("inspect", "change", value, is_word), Limits()) == ViewState()


VIEW_KEYS = st.sampled_from([view.name for view in VIEWS]) | st.text(max_size=5)
FIELD_KEYS = st.sampled_from(sorted({name for _, name in VIEW_FIELDS})) | st.text(max_size=5)
STORED_VIEWS = st.dictionaries(VIEW_KEYS, st.dictionaries(FIELD_KEYS, JSON, max_size=4) | JSON, max_size=4) | JSON
STORED = st.dictionaries(st.sampled_from([*SHARED_FIELDS, "slices", "v", "t", "kind"]) | st.text(max_size=5), JSON)


@settings(deadline=None, max_examples=80)
@given(STORED, STORED_VIEWS)
def test_a_stored_page_of_any_shape_gives_a_sound_page_and_names_what_it_left_out(stored, views):
    default = ViewState(recording_id="mine")
    for value in ({**stored, "views": views}, stored, views):
        state, refused = from_text(json.dumps(value), default)
        assert_sound(state)
        assert_drawn(state)
        assert all(isinstance(name, str) for name in refused)
        assert (state.is_playing, state.is_public, state.visit) == (False, False, 0)
        assert state.of(InspectState).change == NO_CHANGE


@settings(deadline=None, max_examples=80)
@given(STORED, STORED_VIEWS, st.sampled_from([VERSION, 1, "2", None]), st.integers() | PLAIN)
def test_a_link_of_any_shape_leads_to_a_sound_page_or_is_refused_in_one_way(stored, views, version, stamp):
    for value in ({**stored, "views": views, "v": version, "t": stamp, "recording_id": "a"}, stored, views):
        text = base64.urlsafe_b64encode(json.dumps(value).encode()).decode()
        with suppress(LinkError):
            state, _ = from_link(text, ViewState(recording_id="mine", is_public=True))
            assert_sound(state)
            assert_drawn(state)
            assert state.is_public
            assert not state.is_playing


BROKEN = {
    "deep lists": "[" * 100_000,
    "deep objects": '{"views":' * 15_000,
    "closed and deep": "[" * 1000 + "]" * 1000,
    "one level too deep": "[" * (DEEPEST_JSON + 1) + "]" * (DEEPEST_JSON + 1),
    "a number of 5,000 digits": '{"index": %s}' % ("9" * 5000),
    "a negative number of 5,000 digits": '{"views": {"attention": {"head": -%s}}}' % ("9" * 5000),
    "NaN": '{"speed": NaN}',
    "infinity": '{"views": {"attention": {"overlay": -Infinity}}}',
    "too long": '{"index": 1, "tab": "%s"}' % ("x" * 30_000),
    "no JSON": "{'index': 1}",
    "nothing": "",
    "NUL": "\0",
}


@pytest.mark.parametrize("text", BROKEN.values(), ids=BROKEN)
def test_json_out_of_all_bounds_is_refused_whole(text):
    with pytest.raises(ValueError):
        bounded_json(text)
    assert from_text(text, ViewState(index=3)) == (ViewState(index=3), ("the whole stored view",))
    with pytest.raises(LinkError):
        from_link(base64.urlsafe_b64encode(text.encode()).decode(), ViewState())


def test_json_that_no_page_of_ours_writes_is_refused_whole():
    """Numbers no float holds, and half characters, with which no page can be sent."""
    halves = {"tab": "\ud800", "views": {"compare": {"sight": "swipe", "runs": [{"model_id": "\udfff"}]}}}
    overflows = ('{"speed": 1e999, "index": 4}', '{"views": {"attention": {"overlay": 1e999}}, "index": 4}')
    for stored in (*overflows, json.dumps(halves)):
        assert from_text(stored, ViewState()) == (ViewState(), ("the whole stored view",))


def test_the_error_of_a_run_that_is_not_there_is_not_shown_whoever_asks_for_it():
    for stored in ({"camera": "C"}, {"runs": [{}], "camera": "D"}, {"runs": [{}] * 9, "camera": "D"}):
        state, _ = from_text(json.dumps({"views": {"compare": stored}}), ViewState())
        assert_drawn(state)


HEARD = st.sampled_from(["pick", "key", "copied", "touch", "hello", "size", "link", ""])
KEYS = (
    st.sampled_from(
        ["pixel", "cut", "at", "span", "goto", "open", "remove", "workspace", "tab", "stage", "set", "help"]
    )
    | VIEW_KEYS
)
VERBS = st.sampled_from(["pin:a", "edit:drop", "switch", "remove", "choose", "camera"])
PARTS = st.lists(
    st.sampled_from(WORDS) | st.text(max_size=9) | st.builds("{}:{}".format, KEYS, st.text(max_size=9))
    | st.builds("set:{}.{}:{}".format, VIEW_KEYS, FIELD_KEYS, st.sampled_from(WORDS))
    | st.builds("{}:{}:{}".format, KEYS, VERBS, st.sampled_from(WORDS) | st.text(max_size=9)),
    max_size=6,
)  # fmt: skip


@settings(deadline=None, max_examples=200)
@given(HEARD, PARTS, st.integers(0, 3))
def test_whatever_a_page_says_is_an_intent_or_nothing_and_never_leads_out_of_what_there_is(kind, parts, counter):
    for text in ("|".join([kind, *parts, str(counter)]), f"pick|{'|'.join(parts[:1])}|0.5|0.5|{counter}"):
        heard = parse(text, VIEWS)
        state = reduce(ViewState(recording_id="a"), heard, Limits())
        assert_sound(state)
        assert_drawn(state)


@pytest.mark.parametrize("text", [*BROKEN.values(), "link|" + "x" * 100_000, "pick|" * 1000, "pick|at:1,2,3|0|0|1"])
def test_a_message_out_of_all_bounds_is_an_intent_or_nothing(text):
    heard = parse(text, VIEWS)
    assert heard is None or len(heard.value) <= 4000


@pytest.mark.parametrize("policy", [ByCount(3), ByDensity(0.2), ByDuration(5, 2)])
def test_a_value_of_our_own_passes_its_check_as_it_is(policy):
    assert checked(ViewState, "policy", policy) == policy
