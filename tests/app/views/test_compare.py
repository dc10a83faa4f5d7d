"""VisitorRuns over the real server, seen by a browser that is only a websocket: no model, no screen."""

import asyncio
import re
import time

import pytest

from app.views.compare.jobs.scores import MomentScore, ProtocolRun, Strip
from app.views.recording.jobs.fitness import FitnessJob
from etnet.events.denoise import Cleaning
from etnet.windows import BetweenFrames, ByDuration
from tests.app.stand_ins import Browser, served


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


async def open_runs(browser):
    await browser.use(browser.widget("Window"), 15)
    await browser.until_shown("Reconstruction of window 15")
    await browser.use(browser.widget("channel"), "pick|workspace:compare|0|0|1")
    await browser.use(browser.widget("Compare"), "runs at this moment")
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
        await browser.use(browser.widget("Windowing "), "milliseconds")
        await browser.until_shown("every 20 ms")
        await browser.use(browser.widget("Window"), 21)
        await browser.until_shown("Run B: window 10")
        await browser.until_shown("Run A: window 21")
        assert "camera frame taken as the window ends" in browser.html()

    visit(viewer, story, 62)
    run, request = run_requests(viewer)[-1]
    assert (run, request.policy, request.index) == ("run1", ByDuration(20_000), 10)
    assert {request.index for visitor, request in viewer.engine.requests if "/" not in visitor} >= {15, 21}


def test_each_run_can_be_cleaned_and_started_cold(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until_shown("Run B: window 15")
        await browser.use(browser.widget("Cold start here"), True)
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
        await browser.use(browser.widget("Cold start here"), True)
        await browser.until_shown("Run B: window 0")
        await browser.use(browser.widget("Windowing "), "milliseconds")
        await browser.until_shown("no window begins after this moment")
        assert "Run A: window 29" in browser.html()
        await browser.use(browser.widget("Cold start here"), False)
        await browser.until_shown("Run B: window 14")

    visit(viewer, story, 64)


def test_a_run_that_is_removed_costs_nothing_more(viewer):
    async def story(browser):
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until_shown("Run B: window 15")
        await press(browser, "compare:remove:0")
        await browser.until(lambda: 'data-testid="run-B"' not in browser.html())
        await browser.until(lambda: any(visitor.endswith("/run1") for visitor in viewer.engine.dropped))

    visit(viewer, story, 65)


def test_each_inspector_asks_its_own_questions_and_a_closed_one_none(viewer):
    jobs = viewer.engine.jobs

    async def story(browser):
        seen = len(jobs)
        await open_runs(browser)
        await press(browser, "compare:add")
        await browser.until(lambda: any(isinstance(job, MomentScore) for _, _, job in jobs[seen:]))
        await browser.use(browser.widget("Compare"), "scores over time")
        await browser.until(lambda: sum(isinstance(job, Strip) for _, _, job in jobs[seen:]) == 2)
        await browser.use(browser.widget("Protocol’s own range"), True)
        await browser.until(lambda: sum(isinstance(job, ProtocolRun) for _, _, job in jobs[seen:]) == 2)
        await press(browser, "workspace:recording")
        dropped = lambda: {slot for _, slot, job in jobs[seen:] if job is None}  # noqa: E731
        await browser.until(lambda: {"compare.protocol.0", "compare.protocol.1"} <= dropped())
        await press(browser, "set:recording.fits:True")
        await browser.until(lambda: any(isinstance(job, FitnessJob) for _, _, job in jobs[seen:]))
        await press(browser, "set:recording.fits:False")
        await browser.until(lambda: "recording.fitness" in dropped())

    visit(viewer, story, 66)
    asked = next(job for _, _, job in jobs if isinstance(job, MomentScore))
    assert asked.request.policy == BetweenFrames()
    assert asked.frame == 16  # window 15 ends with frame 16


def test_values_are_read_out_at_the_clicked_pixel_also_when_zoomed(viewer):
    async def story(browser):
        await open_runs(browser)
        await browser.use(browser.widget("Zoom"), "4×")
        await browser.until_shown("cut:15,12,10,7")
        await browser.use(browser.widget("channel"), "pick|cut:15,12,10,7|0.55|0.95|7")
        await browser.until_shown("raw values at pixel (20, 18)")
        shown = re.search(r'data-testid="value-camera" data-value="([0-9.]+)"', browser.html())
        assert float(shown[1]) == pytest.approx((18 * 40 + 20) / (40 * 30 - 1), rel=1e-6)
        assert 'data-testid="value-A" data-value="0.5"' in browser.html()

    visit(viewer, story, 67)


def test_messages_about_runs_that_make_no_sense_change_nothing(viewer):
    async def story(browser):
        await open_runs(browser)
        for text in ("compare:", "compare:choose:7", "compare:remove:x", "compare:remove:9", "cut:1,2", "cut:a,b,c,d",
                     "at:1", "span:1", "span:nan,inf", "goto:x", "goto:inf"):  # fmt: skip
            await press(browser, text)
        await browser.use(browser.widget("Window"), 3)
        await browser.until_shown("window 3 of 0 – 29")
        await browser.until_shown("Run A: window 3")

    visit(viewer, story, 68)
