"""What the tab of the recording tells and hands out: the doctor's page, asked for only while it is open."""

import asyncio
import re
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from app.catalogue.entries import Entry
from app.engine.jobs import JobResult, num_bytes
from app.engine.requests import FrameRequest
from app.html.moment import Moment
from app.session.channel import parse
from app.session.demo import may_ask
from app.state import intents as ask
from app.state.stored import to_text
from app.state.view_state import Limits, ViewState
from app.views import VIEWS
from app.views.page import Page
from app.views.recording.html.examination import doctor_html
from app.views.recording.jobs.examination import SLOT, ExaminationJob, examination_jobs
from app.views.recording.jobs.fitness import SLOT as FITNESS_SLOT
from app.views.recording.jobs.fitness import FitnessJob
from app.views.recording.jobs.recording import recording_jobs
from app.views.recording.panel import GONE, RecordingPanel
from app.views.recording.state import RecordingState
from etnet.events.cleaning import Cleaning
from etnet.events.denoise import cleaned
from etnet.events.events import Events
from etnet.events.examine import examine, look_through
from etnet.events.fitness import Fitness
from etnet.events.pixel_counts import HotPixel
from etnet.events.recording import Remark, recording_of_events
from etnet.windows import BetweenFrames, ByCount, plan_windows
from tests.app.fake_gui import FakeGui
from tests.app.reducing import from_text, reduce
from tests.app.stand_ins import SENSOR, Browser, Shelf, recording, served

EXAMINE = ask.Set("recording", "examines", True)
CLOSE = ask.Set("recording", "examines", False)
STATE = ViewState(recording_id="a", model_id="m", precision="fp32", policy=BetweenFrames(), index=7)
REQUEST = FrameRequest("a", "m", "fp32", BetweenFrames(), 7)


@pytest.fixture
def moment():
    opened = recording()
    return Moment("a", BetweenFrames(), 7, opened, plan_windows(opened, BetweenFrames()))


def press(text):
    return f"pick|{text}|0.5|0.5|{time.monotonic_ns()}"


def examined(opened):
    return JobResult(ExaminationJob("a", REQUEST), examine(opened), 1.0, is_whole=True)


def told(html, what):
    return re.search(rf"<dt>{what}</dt><dd>(.*?)</dd>", html)[1]


def test_the_doctor_is_asked_only_while_his_page_is_open():
    assert examination_jobs(STATE, REQUEST) == {}
    opened = reduce(STATE, EXAMINE, Limits())
    assert list(examination_jobs(opened, REQUEST)) == [SLOT]
    assert examination_jobs(reduce(opened, CLOSE, Limits()), REQUEST) == {}


def test_the_answer_is_one_for_every_network_and_every_cut():
    opened = reduce(STATE, EXAMINE, Limits())
    other = FrameRequest("a", "n", "bf16", ByCount(100), 12, wants_attention=True)
    assert examination_jobs(opened, REQUEST) == examination_jobs(opened, other)
    assert ExaminationJob("a", REQUEST) != ExaminationJob("b", REQUEST)


def test_the_job_finds_what_the_command_line_finds():
    opened = recording()
    answers = list(ExaminationJob("a", REQUEST).run(SimpleNamespace(playback=SimpleNamespace(recording=opened)), bool))
    assert answers[-1] == (examine(opened), 1.0)
    assert np.array_equal(answers[-1][0].count_image, examine(opened).count_image)
    assert num_bytes(answers[-1][0]) >= 8 * SENSOR.num_pixels


def playing(opened):
    return SimpleNamespace(playback=SimpleNamespace(recording=opened))


def growing(opened, num_events):
    """The beginning of a recording that is whole by now."""
    return replace(recording_of_events(opened.read(0, num_events), "grows"), latest=lambda: opened)


def test_statistics_are_of_all_events_whatever_a_filter_takes_out(moment):
    opened, cleaning = recording(), Cleaning(support_within=20_000)
    filtered = cleaned(opened, cleaning)
    assert filtered.num_events < opened.num_events
    *_, (found, _) = ExaminationJob("a", REQUEST).run(playing(filtered), bool)
    assert found == examine(opened)
    html = doctor_html(replace(moment, recording=filtered, cleaning=cleaning), examined(opened))
    assert "also of those that the filter takes out" in html
    assert "More events have come since" not in html
    assert "the filter" not in doctor_html(moment, examined(opened))


def test_what_is_measured_of_a_recording_that_grows_is_asked_again_at_every_doubling_and_once_it_is_whole():
    opened, policy = recording(), ByCount(100)
    state = reduce(STATE, EXAMINE, Limits()).put(RecordingState(examines=True, fits=True))

    def asked(part):
        return recording_jobs(state, Moment("a", policy, 0, part, plan_windows(part, policy)), (), lambda request: 0)

    first, near, twice, whole = (asked(part) for part in (*(growing(opened, n) for n in (1100, 1300, 2100)), opened))
    assert first == near
    for slot in (SLOT, FITNESS_SLOT):
        assert len({first[slot], twice[slot], whole[slot]}) == 3
        assert whole[slot].request == FrameRequest("a", "m", "fp32", policy, 0)


def test_what_is_measured_is_what_is_there_by_now_not_what_was_when_it_was_opened():
    opened = recording()
    loaded = playing(growing(opened, 1100))
    assert list(ExaminationJob("a", REQUEST).run(loaded, bool))[-1][0] == examine(opened)
    assert list(FitnessJob(REQUEST).run(loaded, bool))[-1][0].activity.num_looked_at == opened.num_events


def test_pictures_of_statistics_are_those_of_the_events_that_were_looked_through(moment):
    opened = recording()
    part = growing(opened, 1100)
    there = replace(moment, recording_id="grows", recording=opened)
    before, after = (doctor_html(there, examined(each)) for each in (part, opened))
    spans = [re.search(r'data-testid="rates" data-k="([^"]+)"', html)[1] for html in (before, after)]
    assert spans == [f"span:0,{each.span.duration / 1e6}" for each in (part, opened)]
    assert "More events have come since: this is of the first" in before
    assert "More events have come since" not in after


def test_sensor_statistics_of_another_recording_or_filter_are_not_shown_as_this_ones(moment):
    gui, panel = FakeGui(), RecordingPanel()
    panel.build(gui, lambda intent: None)
    state, found = STATE.put(RecordingState(fits=True)), Fitness(hot=(HotPixel(7, 5, 900),))
    for request, is_shown in (
        (REQUEST, True),
        (replace(REQUEST, model_id="n"), True),
        (replace(REQUEST, recording_id="b"), False),
        (replace(REQUEST, cleaning=Cleaning(True)), False),
    ):
        results = {FITNESS_SLOT: JobResult(FitnessJob(request), found, 1.0, is_whole=True)}
        panel.show(Page(state, moment, results=results))
        assert ('data-k="at:7,5"' in gui.html[-1].content) == is_shown


def test_a_browser_does_not_keep_the_page_open_and_the_public_may_not_open_it():
    opened = reduce(STATE, EXAMINE, Limits())
    assert not from_text(to_text(opened), STATE)[0].of(RecordingState).examines
    stored = '{"views": {"recording": {"examines": true, "fits": true}}}'
    assert from_text(stored, STATE) == (STATE, ("recording: examines", "recording: fits"))
    assert not may_ask(EXAMINE, VIEWS)


def test_other_words_of_a_page_change_nothing():
    for text in ("recording:", "recording:examine", "set:recording.examines:maybe", "set:recording.nonsense:True"):
        heard = parse(press(text), VIEWS)
        assert heard is None or reduce(STATE, heard, Limits()) == STATE


def test_the_page_says_the_numbers_that_were_found(moment):
    html = doctor_html(moment, examined(moment.recording))
    exam = examine(moment.recording)
    assert told(html, "Sensor") == "40 × 30 pixels"
    assert told(html, "Events").startswith("6,000; ")
    on = exam.num_on / 6000
    assert told(html, "Polarity") == f"{100 * on:.1f} % ON, {100 * (1 - on):.1f} % OFF"
    assert told(html, "Duplicate timestamps").startswith(f"{exam.num_equal_stamps:,}; ")
    assert told(html, "Camera frames").startswith("31 of 40 × 30, 100.0 a second; the first ")
    assert told(html, "Suggested window").startswith("420 events")
    assert html.count("<rect") == sum(rate > 0 for rate in exam.rates) + sum(step > 0 for step in exam.step_counts)
    assert "data:image/png" in html
    assert 'width="360" height="270" data-area="0,0,40,30"' in html  # the pointer is told the sensor's pixels


def test_what_was_repaired_is_under_its_name_and_nothing_of_a_file_becomes_markup():
    opened = recording_of_events(recording().read(0, 50), "<b>evil</b>")
    object.__setattr__(opened, "remarks", (Remark("repaired", "7 stamps <i>"), Remark("assumed", "a clock in µs")))
    found = Moment("evil", ByCount(10), 0, opened, plan_windows(opened, ByCount(10)))
    html = doctor_html(found, examined(opened))
    assert "<h3>Repaired</h3><ul><li>7 stamps &lt;i&gt;</li></ul>" in html
    assert "<h3>Assumed</h3><ul><li>a clock in µs</li></ul>" in html
    assert "<b>evil" not in html
    assert told(html, "Camera frames") == "none"


def test_a_hot_pixel_is_advised_about():
    opened = recording()
    events = opened.read(0, opened.num_events)
    x, y = events.x.copy(), events.y.copy()
    x[::4], y[::4] = 7, 5
    hot = recording_of_events(Events(x, y, events.t, events.p, events.sensor), "hot")
    found = Moment("hot", ByCount(100), 0, hot, plan_windows(hot, ByCount(100)))
    html = doctor_html(found, examined(hot))
    assert "1 hot pixel makes" in html


def test_an_empty_recording_is_told_of_without_a_picture_of_nothing(moment):
    empty = recording_of_events(moment.recording.read(0, 0), "empty")
    html = doctor_html(Moment("empty", ByCount(10), 0, empty, ()), examined(empty))
    assert "there are no events to look at" in html
    assert "<rect" not in html


def visit(story, tab):
    async def run():
        with served() as viewer:
            async with Browser.open(viewer.port, tab=tab) as browser:
                await browser.until_shown("Reconstruction of window 0")
                await story(viewer, browser)

    asyncio.run(run())


def test_opening_the_workspace_measures_and_leaving_it_ends_that():
    async def story(viewer, browser):
        asked = lambda: [job for _, slot, job in viewer.engine.jobs if slot == SLOT]  # noqa: E731
        assert not asked()
        await browser.use(browser.widget("channel"), press("workspace:recording"))
        await browser.until_shown(", 0%")
        await browser.until(asked)
        job = asked()[-1]
        viewer.engine.tell(SLOT, JobResult(job, None, 0.4))
        await browser.until_shown(", 40%")
        found = list(look_through(viewer.shelf.recordings["a"]))[-1][0]
        viewer.engine.tell(SLOT, JobResult(job, found, 1.0, is_whole=True))
        await browser.until_shown("<dt>Polarity</dt>")
        assert "6,000" in told(browser.html(), "Events")
        await browser.use(browser.widget("channel"), press("set:recording.examines:False"))
        await browser.until(lambda: asked()[-1] is None)
        await browser.until_shown("set:recording.examines:True")
        await browser.use(browser.widget("channel"), press("set:recording.examines:True"))
        await browser.until(lambda: asked()[-1] is not None)
        await browser.use(browser.widget("channel"), press("workspace:inspect"))
        await browser.until(lambda: asked()[-1] is None)

    visit(story, 71)


def test_a_recording_that_was_just_made_appears_without_a_reload_and_one_that_is_written_is_named(monkeypatch):
    names, growing = ["a", "b"], [()]
    monkeypatch.setattr(
        Shelf, "entries", lambda self: tuple(Entry(i, f"take {i}", "data", "", Path(f"{i}.h5")) for i in names)
    )
    monkeypatch.setattr(Shelf, "growing", lambda self: growing[0])

    async def story(viewer, browser):
        choice = browser.widgets[browser.widget("Recording")]
        assert "take b" in browser.html()
        await browser.use(browser.widget("channel"), press("tab:recording"))
        await browser.until(lambda: list(choice["options"]) == ["take a", "take b"])
        growing[0] = ("<new>.raw",)
        await browser.until_shown("once it rests: &lt;new&gt;.raw")
        growing[0] = ()
        names.append("c")
        await browser.until(lambda: "take c" in choice["options"])
        await browser.until(lambda: "once it rests" not in browser.html())
        names.remove("a")
        await browser.until(lambda: "take a" not in choice["options"])
        await browser.until(lambda: choice["value"] == GONE)
        await browser.until_shown("Reconstruction of window 0")

    visit(story, 72)
