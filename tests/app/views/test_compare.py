"""Runs over the real server, seen by a browser that is only a websocket: no model, no screen."""

import asyncio
import time
from dataclasses import replace

import numpy as np
import pytest

from app.engine.denoised import CleanedRecordings
from app.engine.replayed import replayed_windows
from app.session.runs import RunPlan, VisitorRuns
from app.views.compare.jobs.scores import MomentScore, ProtocolRun, Strip
from app.views.export.state import EXPORT_SLOT
from etnet.events.cleaning import Cleaning
from etnet.events.events import Events
from etnet.events.recording import GroundTruth, recording_of_events
from etnet.windows import BetweenFrames, ByDuration
from tests.app.fakes import recording_of
from tests.app.stand_ins import SENSOR, Browser, served


@pytest.fixture(scope="module")
def viewer():
    with served() as running:
        yield running


def visit(viewer, story, tab, **options):
    async def run():
        async with Browser.open(viewer.port, tab=tab, **options) as browser:
            await browser.until_shown("Reconstruction of window 0")
            return await story(browser)

    return asyncio.run(run())


def run_requests(viewer):
    return [(visitor.rpartition("/")[2], request) for visitor, request in viewer.engine.requests if "/run" in visitor]


async def press(browser, text):
    await browser.use(browser.widget("channel"), f"pick|{text}|0.5|0.5|{time.monotonic_ns()}")


async def open_runs(browser, window=15):
    await browser.use(browser.widget("Window"), window)
    await browser.until_shown(f"Reconstruction of window {window}")
    await press(browser, "workspace:compare")
    await browser.until_shown('data-testid="run-A"')


def test_while_nothing_is_compared_nothing_is_asked(viewer):
    before = len(run_requests(viewer)), len(viewer.engine.jobs)

    async def story(browser):
        await browser.use(browser.widget("Window"), 9)
        await browser.until_shown("Reconstruction of window 9")

    visit(viewer, story, 61)
    assert (len(run_requests(viewer)), len(viewer.engine.jobs)) == before


def test_a_run_follows_the_moment_in_its_own_windows(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until_shown("Run B: window 15")
        await press(browser, "compare:windows:1:milliseconds:20")
        await browser.until_shown("every 20 ms")
        await browser.use(browser.widget("Window"), 21)
        await browser.until_shown("Run B: window 10")
        await browser.until_shown("Run A: window 21")
        assert "frame at window end" in browser.html()

    visit(viewer, story, 62)
    run, request = run_requests(viewer)[-1]
    assert (run, request.policy, request.index) == ("run1", ByDuration(20_000), 10)
    assert {request.index for visitor, request in viewer.engine.requests if "/" not in visitor} >= {15, 21}


def test_each_run_can_be_filtered_and_started_cold(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until_shown("Run B: window 15")
        await press(browser, "compare:cold:1:on")
        await browser.until_shown("Run B: window 0")
        await browser.until_shown("cold start at 0.1")
        await press(browser, "compare:cleaned")
        await browser.until_shown("Run C: window 15")
        await browser.use(browser.widget("Window"), 18)
        await browser.until_shown("Run B: window 3")

    visit(viewer, story, 63)
    requests = dict(run_requests(viewer))
    assert requests["run1"].cold_at == 15
    assert requests["run2"].cleaning == Cleaning(hot_pixels=True, support_within=5_000)


def test_a_run_that_cannot_be_says_why_and_the_others_go_on(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.use(browser.widget("Window"), 29)
        await browser.until_shown("Run B: window 29")
        await press(browser, "compare:cold:1:on")
        await browser.until_shown("Run B: window 0")
        await press(browser, "compare:windows:1:milliseconds:20")
        await browser.until_shown("No window begins after this moment")
        assert "Run A: window 29" in browser.html()
        await press(browser, "compare:cold:1:off")
        await browser.until_shown("Run B: window 14")

    visit(viewer, story, 64)


def test_on_a_recording_without_frames_a_run_between_frames_says_one_plain_sentence():
    plan = RunPlan("a", BetweenFrames())
    events = recording_of(20)
    posted = []
    runs = VisitorRuns(None, None, CleanedRecordings(), "ada", posted.append)
    runs._plan(plan, events)
    runs._plan(replace(plan, replays="paper"), events)
    assert [letter.trouble for letter in posted] == [
        "This recording has no camera frames, so its events cannot be cut between them.",
        "This recording has no camera frames, so no protocol can score it.",
    ]


class Growing:
    """Three seconds of events and frames, of which as much is there as a test says."""

    def __init__(self, milliseconds):
        t = np.arange(6_001, dtype=np.int64) * 500
        rng = np.random.default_rng(4)
        places = (rng.integers(0, side, len(t)).astype(np.uint16) for side in (SENSOR.width, SENSOR.height))
        self._events = Events(*places, t, rng.choice(np.array([-1, 1], np.int8), len(t)), SENSOR)
        self.grow(milliseconds)

    def grow(self, milliseconds):
        until = 1_000 * milliseconds
        stamps = np.arange(0, until + 1, 10_000, dtype=np.int64)
        truth = GroundTruth(stamps, lambda i: np.zeros((SENSOR.height, SENSOR.width), np.float32))
        events = self._events[: int(np.searchsorted(self._events.t, until, side="right"))]
        is_whole = milliseconds == 3_000
        made = recording_of_events(events, "growing", ground_truth=truth)
        self.recording = made if is_whole else replace(made, latest=lambda: self.recording)


def test_a_run_in_windows_of_its_own_follows_a_recording_that_grows_to_its_end():
    with served() as viewer:
        growing = Growing(1_000)
        viewer.shelf.recordings["a"] = growing.recording

        async def story(browser):
            await press(browser, "workspace:compare")
            await browser.until_shown('data-testid="run-A"')
            await press(browser, "compare:add")
            await press(browser, "compare:windows:1:milliseconds:100")
            await browser.until_shown("every 100 ms")
            for milliseconds, window, last in ((1_000, 9, 9), (2_000, 19, 19), (3_000, 29, 30)):
                growing.grow(milliseconds)
                await browser.until_shown(f"of 0 – {milliseconds // 10 - 1}")
                await browser.use(browser.widget("Window"), milliseconds // 10 - 1)
                await browser.until_shown(f"Run A: window {milliseconds // 10 - 1}")
                await browser.until_shown(f"window {window} of 0–{last}")

        visit(viewer, story, 76)
        run, request = run_requests(viewer)[-1]
        assert (run, request.policy, request.index) == ("run1", ByDuration(100_000), 29)


def test_a_run_from_a_cold_start_keeps_its_first_window_while_the_recording_grows():
    growing, posted = Growing(1_000), []
    runs = VisitorRuns(None, None, CleanedRecordings(), "ada", posted.append)
    plan = RunPlan("a", ByDuration(100_000), cold_from=420_000)
    runs._plan(plan, growing.recording)
    growing.grow(3_000)
    runs._plan(plan, growing.recording, posted[0])
    first, then = posted
    assert (first.cold_at, then.cold_at) == (5, 5)
    assert list(then.windows)[:5] == list(first.windows)
    assert (len(first.windows), len(then.windows)) == (5, 26)


def test_what_could_not_be_planned_of_a_part_is_planned_when_all_of_it_is_there():
    growing, posted = Growing(1_000), []
    runs = VisitorRuns(None, None, CleanedRecordings(), "ada", posted.append)
    plan = RunPlan("a", BetweenFrames(), Cleaning(hot_pixels=True))
    runs._plan(plan, growing.recording)
    assert "filter it when all of it is there" in posted[0].trouble
    growing.grow(3_000)
    assert posted[0].is_outgrown(growing.recording)
    runs._plan(plan, growing.recording, posted[0])
    assert len(posted[1].windows) == 300


def test_a_run_that_is_removed_costs_nothing_more(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until_shown("Run B: window 15")
        await press(browser, "compare:remove:1")
        await browser.until(lambda: 'data-testid="run-B"' not in browser.html())
        await browser.until(lambda: any(visitor.endswith("/run1") for visitor in viewer.engine.dropped))

    visit(viewer, story, 65)


def test_each_run_is_scored_at_the_moment_and_over_time_while_the_workspace_is_open(viewer):
    jobs = viewer.engine.jobs

    async def story(browser):
        seen = len(jobs)
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until(lambda: sum(isinstance(job, MomentScore) for _, _, job in jobs[seen:]) >= 2)
        await browser.until(lambda: sum(isinstance(job, Strip) for _, _, job in jobs[seen:]) == 2)
        await press(browser, "set:compare.replays:True")
        await browser.until(lambda: sum(isinstance(job, ProtocolRun) for _, _, job in jobs[seen:]) == 2)
        await press(browser, "workspace:inspect")
        dropped = lambda: {slot for _, slot, job in jobs[seen:] if job is None}  # noqa: E731
        await browser.until(lambda: {"compare.time.0", "compare.time.1", "compare.moment.0"} <= dropped())

    visit(viewer, story, 66)
    asked = next(job for _, _, job in jobs if isinstance(job, MomentScore))
    assert asked.request.policy == BetweenFrames()
    assert asked.frame == 16  # window 15 ends with frame 16


def test_in_a_protocols_range_every_run_shows_the_windows_that_the_protocol_feeds(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "set:compare.replays:True")
        await browser.until(lambda: any(run == "run0" for run, _ in run_requests(viewer)))

    visit(viewer, story, 67)
    request = next(request for run, request in run_requests(viewer) if run == "run0")
    opened = viewer.shelf.recordings["a"]
    assert (request.policy, request.cold_at, request.precision) == (replayed_windows(opened, "paper"), 1, "fp32")


def test_choosing_for_run_a_chooses_for_the_page(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:windows:0:milliseconds:20")
        await browser.until_shown("Run A: window 7")

    visit(viewer, story, 68)


def test_messages_about_runs_that_make_no_sense_change_nothing(viewer):
    async def story(browser):
        await open_runs(browser)
        for text in ("compare:", "compare:cold:7:on", "compare:remove:x", "compare:remove:9", "cut:1,2", "cut:a,b,c,d",
                     "at:1", "span:1", "span:nan,inf", "goto:x", "goto:inf", "compare:windows:3:ms:1e999"):  # fmt: skip
            await press(browser, text)
        await browser.use(browser.widget("Window"), 3)
        await browser.until_shown("window 3 of 0 – 29")
        await browser.until_shown("Run A: window 3")

    visit(viewer, story, 69)


def test_the_runs_on_the_stage_are_what_is_exported_and_the_page_alone_elsewhere(viewer):
    ordered = lambda: [job.order.wanted for _, slot, job in viewer.engine.jobs if slot == EXPORT_SLOT and job]  # noqa: E731

    async def story(browser):
        await open_runs(browser)
        await press(browser, "tab:export")
        await browser.until(lambda: browser.is_open("Export"))
        options = lambda: browser.widgets[browser.widget("Pictures")]["options"]  # noqa: E731
        await browser.until(lambda: "reconstruction" in options())
        await press(browser, "compare:add")
        await press(browser, "compare:windows:1:milliseconds:20")
        await browser.until(lambda: list(options())[:2] == ["runs, camera", "runs"])
        await browser.until(lambda: "windows=duration=20ms" in browser.html())
        await browser.use(browser.widget("Export"), True)
        await browser.until(ordered)
        await press(browser, "workspace:inspect")
        await press(browser, "tab:export")
        await browser.until(lambda: "reconstruction" in options())

    visit(viewer, story, 75)
    (wanted,) = ordered()
    assert [run.request.policy for run in wanted.runs] == [BetweenFrames(), ByDuration(20_000)]
    assert wanted.panels == ("reconstruction", "camera")
