"""The timeline is an axis of time: windows, triggers, marks and what is cached stand where they are in time."""

import re
from dataclasses import replace

import numpy as np
import pytest

from app.engine.published import LARGEST_THUMBNAILS, THUMBNAIL_WIDTH, Thumbnails
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.html.timeline_marks import NothingCached
from app.session.channel import Hover, parse
from app.state import intents as ask
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.timeline.html import legend_html, marks_html, now_html, speed_html, timeline_html, transport_html
from app.views.timeline.state import SPEEDS, hear, speed_of
from app.views.view import reduce_views
from etnet.events.events import Events, Sensor
from etnet.events.recording import recording_of_events
from etnet.events.triggers import Triggers
from etnet.windows import ByCount, ByDuration, plan_windows

SENSOR = Sensor(40, 30)


def recording(num_events=4000, stop=1_000_000):
    rng = np.random.default_rng(3)
    t = np.sort(rng.integers(0, stop, num_events)).astype(np.int64)
    t[0], t[-1] = 0, stop
    x, y = rng.integers(0, 40, num_events), rng.integers(0, 30, num_events)
    p = rng.choice(np.array([-1, 1], np.int8), num_events)
    made = recording_of_events(Events(x.astype(np.uint16), y.astype(np.uint16), t, p, SENSOR), "made")
    stamps = np.array([100_000, 250_000, 900_000], np.int64)
    return replace(made, triggers=Triggers(stamps, np.array([2, 2, 0], np.int16), np.array([1, -1, 0], np.int8)))


def moment_of(policy, index=3):
    opened = recording()
    return Moment("a", policy, index, opened, plan_windows(opened, policy))


def limits_of(moment):
    return Limits(SENSOR, moment.windows, moment.recording.span.start)


def reduced(state, *intents, limits):
    for intent in intents:
        state = reduce_views(state, intent, limits, VIEWS)
    return state


@pytest.mark.parametrize("policy", [ByCount(200), ByDuration(70_000)])
def test_the_head_stands_at_its_time_whatever_the_windows(policy):
    moment = moment_of(policy)
    html = timeline_html(moment)
    place = float(re.search(r"et-head-line\" style=\"--x:([0-9.]+)%", html)[1])
    assert place == pytest.approx(100 * moment.window.t_stop / 1_000_000, abs=0.01)
    assert 'data-k="span:0,1.000000"' in html


def test_a_trigger_is_a_tick_at_its_time_and_a_click_jumps_there():
    moment = moment_of(ByCount(200))
    html = timeline_html(moment)
    found = re.findall(r'et-trigger" data-k="(goto:[0-9.]+)".*?title="([^"]+)" style="left:([0-9.]+)%', html)
    assert [float(left) for _, _, left in found] == [10, 25, 90]
    assert found[1][1] == "Trigger, input 2 falling, 0.250 s"
    intent = parse(f"pick|{found[1][0]}|0.5|0.5|1", VIEWS)
    state = reduced(ViewState(policy=ByCount(200)), intent, limits=limits_of(moment))
    near = moment.windows[state.index].t_stop
    assert all(abs(near - 250_000) <= abs(window.t_stop - 250_000) for window in moment.windows)


def test_every_button_of_the_transport_and_every_speed_is_heard():
    state = ViewState(speed=0.25)
    keys = re.findall(r'data-k="timeline:([^"]+)"', transport_html(state) + speed_html(state))
    assert len(keys) == 6 + len(SPEEDS)
    assert all(hear(key) is not None for key in keys)
    assert speed_of(0.25, False) == "¼"
    assert speed_of(0.25, True) == "step"
    assert speed_of(0.2, False) == ""


def test_the_state_lane_tells_exact_kept_cold_approximate_and_changed_windows():
    moment = moment_of(ByDuration(100_000))
    held = type("Held", (), {"frames": (range(1, 3),), "states": (range(1, 5),), "is_exact": True})()
    html = timeline_html(moment, held, approximate=range(7, 8), changed=range(8, 10))
    boxes = re.findall(r'<rect x="([0-9.]+)" y="\d+" width="([0-9.]+)" height="\d+" fill="var\(--([a-z-]+)\)"', html)
    at = {colour: (float(x), float(width)) for x, width, colour in boxes}
    assert at["cold"] == (0, 1000)
    assert at["exact"] == pytest.approx((100, 200), abs=0.2)
    assert at["kept"] == pytest.approx((100, 400), abs=0.2)
    assert at["warning"] == pytest.approx((700, 100), abs=0.2)
    assert at["accent-strong"] == pytest.approx((800, 200), abs=0.2)
    words = legend_html(moment, is_approximate=True, is_changed=True)
    assert all(word in words for word in ("exact", "state kept", "cold", "approximate", "intervention on", "triggers"))
    assert "approximate" not in legend_html(moment, is_approximate=False, is_changed=False)


def test_frames_that_may_not_be_called_exact_are_not_drawn_so():
    held = NothingCached(frames=(range(1, 3),), is_exact=False)
    html = timeline_html(moment_of(ByDuration(100_000)), held)
    assert "--exact" not in html
    assert html.count("var(--kept)") == 1


def test_windows_are_numbered_from_zero():
    moment = moment_of(ByDuration(100_000), 0)
    assert "window 0 <i>of 0 – 10</i>" in now_html(moment)


def test_marks_are_put_by_key_and_by_hand_and_the_later_one_wins():
    moment = moment_of(ByDuration(100_000))
    limits = limits_of(moment)
    state = ViewState(policy=moment.policy, index=3)
    state = reduced(state, ask.MarkHere("a"), ask.Seek(6), ask.MarkHere("b"), limits=limits)
    assert (state.mark_a, state.mark_b) == (300_000, 700_000)
    assert limits.stretch(state.mark_a, state.mark_b) == range(3, 7)
    moved = reduced(state, parse("pick|mark:a:0,1.0|0.5|0|1", VIEWS), limits=limits)
    assert (moved.mark_a, moved.mark_b) == (500_000, 700_000)
    crossed = reduced(state, ask.PutMark("a", 0.8), limits=limits)
    assert (crossed.mark_a, crossed.mark_b) == (800_000, None)
    assert reduced(state, ask.ClearMarks(), limits=limits).mark_b is None
    assert reduced(state, ask.OpenRecording("other"), limits=limits).mark_a is None


def test_the_marks_are_drawn_where_they_are_and_can_be_dragged_and_cleared():
    moment = moment_of(ByDuration(100_000))
    state = ViewState(mark_a=300_000, mark_b=700_000)
    html = timeline_html(moment, None, state)
    assert re.findall(r'data-k="mark:([ab]):0,1.000000".*?left:([0-9.]+)%', html) == [("a", "30.000"), ("b", "70.000")]
    assert 'et-between" style="left:30.000%;width:40.000%' in html
    said = marks_html(moment, state)
    assert "0.300 s – 0.700 s" in said
    assert 'data-k="timeline:clear"' in said
    assert marks_html(moment, ViewState()) == ""


def test_a_loop_plays_between_the_marks_and_without_looping_it_stops_at_the_second():
    limits = limits_of(moment_of(ByDuration(100_000)))
    state = ViewState(index=6, is_playing=True, mark_a=300_000, mark_b=700_000, policy=ByDuration(100_000))
    again = reduced(state, ask.PlayTo(7), limits=limits)
    assert (again.index, again.is_playing) == (3, True)
    stopped = reduced(replace(state, loops=False), ask.PlayTo(8), limits=limits)
    assert (stopped.index, stopped.is_playing) == (6, False)
    assert reduced(stopped, ask.TogglePlay(), limits=limits).index == 3
    beyond = reduced(replace(state, index=8), ask.PlayTo(9), limits=limits)
    assert (beyond.index, beyond.is_playing) == (9, True)


@pytest.mark.parametrize(("begin", "end", "wanted"), [
    (None, None, range(11)), (None, 300_000, range(3)), (950_000, None, range(9, 11)), (310_000, 320_000, range(2, 3)),
])  # fmt: skip
def test_a_stretch_always_holds_a_window(begin, end, wanted):
    assert limits_of(moment_of(ByDuration(100_000))).stretch(begin, end) == wanted


def test_small_frames_are_kept_by_window_within_a_budget():
    request = FrameRequest("a", "m", "fp32", ByCount(5), 0)
    kept = Thumbnails(3 * 2 * THUMBNAIL_WIDTH * 87)
    for index in range(5):
        kept.keep(replace(request, index=index), np.full((180, 240), index, np.float32))
    assert kept.find(request) is None
    assert kept.find(replace(request, index=4)).shape == (87, THUMBNAIL_WIDTH)
    assert kept.find(replace(request, index=4)).mean() == 4
    assert kept.nbytes <= 3 * 2 * THUMBNAIL_WIDTH * 87 <= LARGEST_THUMBNAILS
    kept.forget("a")
    assert kept.nbytes == 0


@pytest.mark.parametrize(("text", "wanted"), [
    ("hover|0.5|1", Hover(0.5)), ("hover||1", Hover(None)), ("hover|nan|1", Hover(None)), ("hover|x|1", None),
    ("hover|-3|1", Hover(0.0)), ("pick|mark:a:0,x|0|0|1", None),
])  # fmt: skip
def test_what_the_pointer_says_is_checked(text, wanted):
    assert parse(text, VIEWS) == wanted
