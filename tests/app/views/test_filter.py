"""A filter belongs to the page: everything that is made of the events is made of what it leaves."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from app.catalogue.cut import with_cut
from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest, Ready
from app.engine.warmth import first_warm, warm_up_steps, windows_seen
from app.html.moment import Moment
from app.html.provenance import ModelFacts
from app.session.channel import parse
from app.state import intents as ask
from app.state.link import from_link, to_link
from app.state.stored import from_text, to_text
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.export.state import StartExport, order_of
from app.views.filter.html import filter_html
from app.views.filter.jobs import StatisticsJob, filter_jobs
from app.views.filter.state import STATISTICS_SLOT
from app.views.filter.why import findings, why_html
from app.views.page import Page
from app.views.view import reduce_views
from etnet.errors import RecordingError
from etnet.events.cleaning import Cleaning, parse_cleaning
from etnet.events.denoise import cleaned, num_masked, removed_share, uncleaned
from etnet.events.events import Events, Sensor
from etnet.events.fitness import Activity, Fitness, Lag
from etnet.events.pixel_counts import HotPixel
from etnet.events.recording import recording_of_events
from etnet.live.buffer import Extent
from etnet.windows import ByCount, ByDensity, ByDuration, plan_windows
from tests.app.stand_ins import CONTRACT

SENSOR = Sensor(40, 30)
INITIAL = [view.initial for view in VIEWS]


def recording(num_events=4000, stop=1_000_000, hot=0):
    rng = np.random.default_rng(3)
    t = np.sort(rng.integers(0, stop, num_events + hot)).astype(np.int64)
    x, y = rng.integers(0, 40, num_events + hot), rng.integers(0, 30, num_events + hot)
    x[:: max(1, (num_events + hot) // max(hot, 1))][:hot] = 5
    y[:: max(1, (num_events + hot) // max(hot, 1))][:hot] = 6
    p = rng.choice(np.array([-1, 1], np.int8), num_events + hot)
    return recording_of_events(Events(x.astype(np.uint16), y.astype(np.uint16), t, p, SENSOR), "made")


def page_of(opened, policy, index, ready=None, results=None, model=None, state=None):
    windows = plan_windows(opened, policy)
    state = state or ViewState("a", "m", policy=policy, index=index)
    moment = Moment("a", policy, index, opened, windows, state.cleaning)
    return Page(state, moment, ready, model=model or ModelFacts("a network", (0.1, 1.0)), results=results or {})


@pytest.mark.parametrize("text", ["hot", "5ms", "hot,5ms", "hot,5ms,2", "250us", ""])
def test_a_filter_is_its_own_text(text):
    assert parse_cleaning(text).text == text


@pytest.mark.parametrize(
    "text", ["warm", "5", "5ms,9", "5ms,0", "hot,5ms,2,1", "hot,hot", "ms", "-5ms", "0ms", "1.2.3ms"]
)
def test_what_is_no_filter_is_refused_with_the_forms_there_are(text):
    with pytest.raises(RecordingError, match="filter"):
        parse_cleaning(text)


def test_more_neighbours_leave_fewer_events_and_each_is_supported_by_so_many():
    opened = recording(8000)
    kept = [cleaned(opened, Cleaning(False, 20_000, number)).num_events for number in (1, 2, 3)]
    assert opened.num_events > kept[0] > kept[1] > kept[2] > 0
    filtered = cleaned(opened, Cleaning(False, 20_000, 2))
    assert uncleaned(filtered) is opened
    assert removed_share(filtered) == pytest.approx(1 - kept[1] / 8000)
    whole, left = opened.read(0, 8000), filtered.read(0, 200)
    for x, y, t in zip(left.x[100:], left.y[100:], left.t[100:], strict=True):
        near = (abs(whole.x.astype(int) - int(x)) <= 1) & (abs(whole.y.astype(int) - int(y)) <= 1)
        other = near & ~((whole.x == x) & (whole.y == y)) & (whole.t <= t) & (whole.t >= t - 20_000)
        assert len({(a, b) for a, b in zip(whole.x[other], whole.y[other], strict=True)}) >= 2


def test_every_button_says_the_whole_filter_that_a_click_asks_for():
    state = ViewState("a", "m", policy=ByCount(100), cleaning=Cleaning(True, 5000, 2))
    page = page_of(cleaned(recording(hot=800), state.cleaning), ByCount(100), 1, state=state)
    html = filter_html(page)
    keys = re.findall(r'data-k="([^"]+)"', html)
    asked = [parse(f"pick|{key}|0|0|1", VIEWS).cleaning for key in keys]
    assert Cleaning(False, 5000, 2) in asked
    assert Cleaning(True, 0, 2) in asked or Cleaning(True) in asked
    assert Cleaning(True, 50_000, 2) in asked
    assert Cleaning(True, 5000, 4) in asked
    assert re.search(r"removes \d+\.\d %", html)
    assert "1 masked" in html
    assert num_masked(page.moment.recording) == 1


def test_a_chosen_filter_stays_in_link_stored_page_and_order_and_goes_with_the_recording():
    limits = Limits(SENSOR, plan_windows(recording(), ByCount(100)), 0)
    state = ViewState("a", "m", policy=ByCount(100), index=4)
    filtered = reduce_views(state, parse("pick|filter:hot,5ms|0|0|1", VIEWS), limits, VIEWS)
    wanted = Cleaning(True, 5000)
    assert filtered.cleaning == wanted
    assert filtered.moment == limits.windows[4].t_stop
    assert from_link(to_link(filtered, 7), ViewState(), INITIAL)[0].cleaning == wanted
    assert from_text(to_text(filtered), ViewState(), INITIAL)[0].cleaning == wanted
    assert order_of(filtered, StartExport("mp4")).cleaning == wanted
    assert reduce_views(filtered, ask.OpenRecording("b"), limits, VIEWS).cleaning == Cleaning()


def test_a_link_with_a_filter_that_cannot_be_is_left_out():
    state, refused = from_text('{"cleaning": {"neighbours": 99}}', ViewState(), INITIAL)
    assert state.cleaning == Cleaning()
    assert refused == ("cleaning",)


def test_moments_of_another_filter_are_other_moments():
    opened = recording()
    windows = plan_windows(opened, ByCount(100))
    plain, filtered = (Moment("a", ByCount(100), 3, opened, windows, c) for c in (Cleaning(), Cleaning(True)))
    assert plain != filtered
    assert plain.key != filtered.key


@pytest.mark.parametrize(("density", "index", "seen"), [(0.014, 20, 5), (0.1, 20, 20), (0.1, 7, 7), (0.014, 79, 20)])
def test_a_state_is_warm_when_windows_and_events_suffice(density, index, seen):
    opened = recording(round(density * 1200 * 80))
    windows = plan_windows(opened, ByCount(round(density * 1200)))
    found = windows_seen(windows, index, 20, 1200, 0.05)
    assert abs(found - seen) <= 1
    first = first_warm(windows, 20, 1200, 0.05)
    assert first is None or windows_seen(windows, first, 20, 1200, 0.05) == 20 > windows_seen(
        windows, first - 1, 20, 1200, 0.05
    )
    steps = warm_up_steps(windows, 20, 1200, 0.05)
    for each in range(len(windows)):
        assert sum(step <= each for step in steps) == windows_seen(windows, each, 20, 1200, 0.05)


def test_where_the_memory_was_empty_later_it_is_warm_later():
    windows = plan_windows(recording(9600), ByCount(120))
    later = first_warm(windows, 20, 1200, 0.05, first=30)
    assert later == first_warm(windows, 20, 1200, 0.05) + 30
    assert windows_seen(windows, 37, 20, 1200, 0.05, first=30) == 7
    assert windows_seen(windows, 29, 20, 1200, 0.05, first=30) == 0


def test_of_a_live_recording_it_is_not_said_that_it_will_never_be_warm():
    whole, policy = recording(400), ByDuration(10_000)
    windows = tuple(plan_windows(whole, policy))
    going_on = with_cut(whole, policy, windows, lambda: Extent(400, 0, None, None, None, None))
    request, frame = FrameRequest("a", "m", "fp32", policy, 3), np.zeros((30, 40), np.float32)
    ready = Ready(request, frame, None, 1.0, False, False, True, CONTRACT, 1, began_at=2, num_seen=1, warm_up=2_000)
    for opened, never in ((whole, True), (going_on, False)):
        told = {finding.name: finding for finding in findings(page_of(opened, policy, 3, ready))}
        assert "Warm-up 1 of 2000" in told["warm-up"].text
        assert ("will not be warm" in told["warm-up"].text) == never


def test_each_reason_comes_with_a_button_that_helps():
    opened, policy = recording(400), ByDuration(10_000)
    request = FrameRequest("a", "m", "fp32", policy, 3)
    frame = np.zeros((30, 40), np.float32)
    ready = Ready(request, frame, None, 1.0, True, False, True, CONTRACT, 3, num_seen=1, warm_up=5)
    found = Fitness(Activity(9, 0.9, 4.0, 50.0), (HotPixel(5, 6, 900),), Lag(8000, 0.8, 0.4))
    job = StatisticsJob(replace(request, index=0))
    results = {STATISTICS_SLOT: JobResult(job, found, 1.0, is_whole=True)}
    card = {"noise_rate": [0.0, 1.0]}
    page = page_of(opened, policy, 3, ready, results, ModelFacts("a network", (0.1, 1.0), card))
    told = {finding.name: finding for finding in findings(page)}
    assert set(told) == {"warm-up", "density", "static", "hot", "offset", "range"}
    assert "Warm-up 1 of 5" in told["warm-up"].text
    html = why_html(page)
    for key in re.findall(r'data-k="([^"]+)"', html):
        assert parse(f"pick|{key}|0|0|1", VIEWS) is not None, key
    assert parse(f"pick|{told['density'].key}|0|0|1", VIEWS) == ask.ChoosePolicy(ByDensity(0.35))
    assert parse(f"pick|{told['hot'].key}|0|0|1", VIEWS) == ask.ChooseCleaning(Cleaning(True))
    assert parse(f"pick|{told['offset'].key}|0|0|1", VIEWS) == ask.Set("compare", "offset", "8000", is_word=True)


@pytest.mark.parametrize(("active", "said"), [
    (0, "100 %"), (1, "more than 99 %"), (11, "more than 99 %"), (12, "99 %"), (23, "98 %"),
])  # fmt: skip
def test_pixels_without_events_are_all_of_them_only_where_none_has_one(active, said):
    numbers = np.arange(active)
    t = np.r_[0, 11_000 + numbers, 25_000].astype(np.int64)  # an event in the window before, and one in that after
    x, y = np.r_[0, numbers % 40, 0].astype(np.uint16), np.r_[0, numbers // 40, 0].astype(np.uint16)
    opened = recording_of_events(Events(x, y, t, np.ones(active + 2, np.int8), SENSOR), "still")
    page = page_of(opened, ByDuration(10_000), 1)
    page = replace(page, moment=replace(page.moment, recording_id=f"still {active}"))
    assert page.moment.window.num_events == active
    told = {finding.name: finding.text for finding in findings(page)}
    assert f"No events in {said} of the pixels" in told["static"]


def test_statistics_of_another_filter_say_nothing():
    opened, policy = recording(), ByCount(400)
    request = FrameRequest("a", "m", "fp32", policy, 3)
    ready = Ready(request, np.zeros((30, 40), np.float32), None, 1.0, True, False, False, CONTRACT, 3)
    job = StatisticsJob(replace(request, index=0, cleaning=Cleaning(True)))
    results = {STATISTICS_SLOT: JobResult(job, Fitness(hot=(HotPixel(1, 1, 99),)), 1.0, is_whole=True)}
    assert not [each for each in findings(page_of(opened, policy, 3, ready, results)) if each.name == "hot"]


def test_what_the_recording_is_like_is_asked_while_the_tab_is_open_and_again_as_it_grows():
    opened, policy = recording(), ByCount(400)
    state = ViewState("a", "m", policy=policy, index=3)
    asked = []
    for part in (replace(recording_of_events(opened.read(0, 900), "grows"), latest=lambda: opened), opened):
        moment = Moment("a", policy, 0, part, plan_windows(part, policy))
        (slot, job), *others = filter_jobs(state, moment, (), lambda request: 0).items()
        assert (slot, others) == (STATISTICS_SLOT, [])
        asked.append(job)
    assert asked[0] != asked[1]
    assert asked[0].request == asked[1].request
    loaded = SimpleNamespace(playback=SimpleNamespace(recording=part))
    assert list(asked[0].run(loaded, bool))[-1][0].activity.num_looked_at == opened.num_events


def test_nothing_is_called_sound_before_this_frame_and_this_recording_are_known():
    opened, policy = recording(), ByCount(400)
    request = FrameRequest("a", "m", "fp32", policy, 3)
    ready = Ready(request, np.zeros((30, 40), np.float32), None, 1.0, True, False, False, CONTRACT, 3)
    known = {STATISTICS_SLOT: JobResult(StatisticsJob(replace(request, index=0)), Fitness(), 1.0, is_whole=True)}
    other = StatisticsJob(replace(request, index=0, cleaning=Cleaning(True)))
    of_another = {STATISTICS_SLOT: JobResult(other, Fitness(), 1.0, is_whole=True)}
    assert "Nothing found" in why_html(page_of(opened, policy, 3, ready, known))
    for shown, results in (
        (ready, of_another),
        (None, known),
        (replace(ready, is_former=True), known),
        (replace(ready, request=replace(request, index=2)), known),
    ):
        html = why_html(page_of(opened, policy, 3, shown, results))
        assert "Nothing found" not in html
        assert "Measuring" in html
