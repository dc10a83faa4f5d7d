"""A visit over the real server, seen by a browser that is only a websocket: no model, no screen."""

import asyncio
import json
import time
from types import SimpleNamespace

import pytest

from tests.app.stand_ins import Browser, served


@pytest.fixture(scope="module")
def viewer():
    with served() as running:
        yield running


def visit(viewer, story, **options):
    async def run():
        async with Browser.open(viewer.port, **options) as browser:
            await browser.until_shown('data-testid="timeline"')
            return await story(browser)

    return asyncio.run(run())


async def press(browser, key):
    await browser.use(browser.widget("channel"), f"pick|{key}|0.5|0.5|{time.monotonic_ns()}")


def newest_session(viewer):
    return viewer.sessions[max(viewer.sessions)]


def test_the_page_opens_on_the_first_recording_with_everything_drawn(viewer):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        html = browser.html()
        for name in ("events", "voxels", "camera", "provenance", "timeline", "scene-legend"):
            assert f'data-testid="{name}"' in html
        assert all(f'data-k="open:{recording_id}"' in html for recording_id in ("a", "b", "broken"))

    visit(viewer, story)


def test_the_event_view_follows_the_slider_while_the_model_is_busy(viewer):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        viewer.engine.is_held = True
        began = time.monotonic()
        await browser.use(browser.widget("Window"), 25)
        await browser.until_shown("window 25 of 0 – 29")
        assert time.monotonic() - began < 5
        await browser.until_shown("Frame 25: warm-up 14 of 19 · shows frame 0")

    try:
        visit(viewer, story, tab=21)
    finally:
        viewer.engine.is_held = False


def test_a_frame_at_hand_is_drawn_at_once_with_its_events(viewer):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        viewer.engine.has_frames_at_hand = True
        await browser.use(browser.widget("Window"), 22)
        await browser.until_shown("Reconstruction of window 22")
        assert "showing 0" not in str([message for _, _, message in browser.arrivals])

    try:
        visit(viewer, story, tab=22)
    finally:
        viewer.engine.has_frames_at_hand = False


def test_a_value_beyond_the_recording_is_brought_inside(viewer):
    async def story(browser):
        await browser.use(browser.widget("Window"), 99_999)
        await browser.until_shown("window 29 of 0 – 29")
        await browser.use(browser.widget("Window"), -5)
        await browser.until_shown("window 0 of 0 – 29")

    visit(viewer, story, tab=22)


def test_messages_that_make_no_sense_change_nothing(viewer):
    async def story(browser):
        for text in ("", "pick", "pick|pixel|x|y|1", "pick|pixel|nan|inf|1", "pick|head:many|0|0|1", "hello|a|b|c|1",
                     "size|-1|x|1", "|" * 500, "pick|bin:|0|0|9|9"):  # fmt: skip
            await browser.use(browser.widget("channel"), text)
        await browser.use(browser.widget("Speed"), "no such speed")  # of another type it would end the page
        await browser.use(browser.widget("Window"), 3)
        await browser.until_shown("window 3 of 0 – 29")

    visit(viewer, story, tab=23)


def test_a_click_on_a_picture_asks_for_that_pixel(viewer):
    async def story(browser):
        await browser.use(browser.widget("channel"), "pick|pixel|0.99999|0.5|4")
        await browser.until(lambda: viewer.engine.requests[-1][1].wants_attention)
        assert newest_session(viewer)._state.query == (39, 15)
        await browser.until_shown('data-testid="query"')

    visit(viewer, story, tab=24)


def test_two_visitors_scrub_alone(viewer):
    async def run():
        async with Browser.open(viewer.port, tab=31) as one, Browser.open(viewer.port, tab=32) as two:
            for browser in (one, two):
                await browser.until_shown("Reconstruction of window 0")
            await one.use(one.widget("Window"), 5)
            await two.use(two.widget("Window"), 9)
            await one.until_shown("Reconstruction of window 5")
            await two.until_shown("Reconstruction of window 9")
            assert "window 9 of 0 – 29" not in one.words()
            assert "window 5 of 0 – 29" not in two.words()

    asyncio.run(run())


def test_a_view_comes_back_with_its_tab_and_only_with_it(viewer):
    storage = {}

    async def leave(browser):
        await browser.use(browser.widget("Window"), 17)
        await browser.until_shown("window 17 of 0 – 29")
        await browser.until(lambda: any('"index":17' in kept for kept in browser.storage.values()))

    async def come_back(browser):
        await browser.until_shown("window 17 of 0 – 29")

    async def come_anew(browser):
        await browser.until_shown("window 0 of 0 – 29")

    visit(viewer, leave, tab=41, storage=storage)
    visit(viewer, come_back, tab=41, storage=storage)
    visit(viewer, come_anew, tab=42, storage=storage)


def test_a_kept_view_that_makes_no_sense_is_left_out_and_said(viewer):
    kept = json.dumps({"recording_id": "gone", "index": 4, "views": {"reconstruction": {"tone": "sepia"}}})

    async def story(browser):
        await browser.until(lambda: browser.notices != [])
        assert "reconstruction: tone" in browser.notices[0]["body"]
        assert "the recording" in browser.notices[0]["body"]

    visit(viewer, story, tab=43, storage={"view:a:43": kept})


def test_what_cannot_be_opened_is_told_and_the_page_goes_on(viewer):
    async def story(browser):
        await press(browser, "open:broken")
        await browser.until(lambda: browser.notices != [])
        assert browser.notices[0]["body"] == "broken.h5: the file ends at byte 12; copy it again"
        await press(browser, "tab:recording")
        await browser.until_shown("the file ends at byte 12")
        await press(browser, "open:b")
        await browser.until(lambda: viewer.engine.requests[-1][1].recording_id == "b")
        await browser.until_shown("window 0 of 0 – 19")

    visit(viewer, story, tab=44)


def test_an_open_that_fails_as_nobody_expected_is_told_and_the_page_does_not_wait_for_it(viewer, monkeypatch):
    def broken(recording_id, progress=None):
        raise ZeroDivisionError("nobody expected this")

    async def story(browser):
        monkeypatch.setattr(viewer.shelf, "open", broken)
        await press(browser, "open:b")
        await browser.until(lambda: browser.notices != [])
        assert "nobody expected this" in browser.notices[0]["body"]
        monkeypatch.undo()
        await press(browser, "open:b")
        await browser.until_shown("window 0 of 0 – 19")

    visit(viewer, story, tab=46)


def test_a_page_that_has_gone_cannot_be_told_and_its_visit_ends_as_others_do(viewer, monkeypatch):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        session, tried = newest_session(viewer), []

        def gone(title, body):
            tried.append(title)
            raise UserWarning("Queued a NotificationShowMessage on a closed connection")

        def broken(*args):
            raise ValueError("is closed")

        monkeypatch.setattr(session._showing, "refuse", gone)
        monkeypatch.setattr(session, "_composer", SimpleNamespace(page=broken))
        await browser.use(browser.widget("Window"), 4)
        await browser.until(lambda: tried != [])
        monkeypatch.undo()
        await browser.use(browser.widget("Window"), 5)
        await browser.until_shown("Reconstruction of window 5")

    visit(viewer, story, tab=47)


def test_a_failed_request_is_an_alert_in_the_picture(viewer):
    async def story(browser):
        viewer.engine.failure = "out of memory; start the viewer with a smaller --budget"
        await browser.use(browser.widget("Window"), 2)
        await browser.until_shown("out of memory")
        viewer.engine.failure = ""
        await browser.use(browser.widget("Window"), 3)
        await browser.until_shown("Reconstruction of window 3")

    visit(viewer, story, tab=45)


def test_other_windows_are_planned_live_and_the_moment_stays(viewer):
    async def story(browser):
        await press(browser, "tab:recording")
        await browser.use(browser.widget("Window"), 15)
        await browser.until_shown("window 15 of 0 – 29")
        await browser.use(browser.widget("Windowing"), "milliseconds")
        await browser.until_shown("every 20 ms")
        await browser.until_shown("window 7 of 0 – 14")
        await browser.use(browser.widget("Size"), 5.0)
        await browser.until_shown("every 5.0 ms")

    visit(viewer, story, tab=46)


def test_a_recording_that_cannot_be_opened_leaves_the_present_one_alone(viewer):
    async def story(browser):
        await browser.use(browser.widget("Window"), 9)
        await browser.until_shown("Reconstruction of window 9")
        await browser.use(browser.widget("channel"), "pick|open:broken|0|0|1")
        await browser.until(lambda: browser.notices)
        await browser.until_shown("window 9 <i>of 0 – 29")
        await browser.until_shown("Reconstruction of window 9")
        await browser.use(browser.widget("channel"), "pick|open:broken|0|0|2")
        await browser.until(lambda: len(browser.notices) > 1)
        await browser.use(browser.widget("channel"), "pick|timeline:on|0|0|3")
        await browser.until_shown("Reconstruction of window 10")

    visit(viewer, story, tab=61)


def test_where_the_pointer_is_stands_in_the_page_only_while_it_hovers(viewer):
    async def story(browser):
        await browser.use(browser.widget("channel"), "hover|0.1000|1")
        await browser.until_shown('data-words="0.100 s · window 9"')
        await browser.use(browser.widget("channel"), "hover||2")
        await browser.until(lambda: "data-words" not in browser.html())

    visit(viewer, story, tab=62)


def test_a_filter_is_asked_of_the_engine_and_stays_at_the_moment(viewer):
    async def story(browser):
        await browser.use(browser.widget("Window"), 9)
        await browser.until_shown("Reconstruction of window 9")
        await browser.use(browser.widget("channel"), "pick|filter:20ms|0|0|1")
        await browser.until(lambda: viewer.engine.requests[-1][1].cleaning.support_within == 20_000)
        await browser.until_shown("window 9 <i>of 0 – 29")
        await browser.use(browser.widget("channel"), "pick|tab:filter|0|0|2")
        await browser.until_shown("removes ")

    visit(viewer, story, tab=63)


def test_playing_waits_for_each_image_when_told_to_and_stops_at_a_touch(viewer):
    async def story(browser):
        await browser.use(browser.widget("channel"), "pick|timeline:speed step|0|0|1")
        await browser.use(browser.widget("channel"), "pick|timeline:play|0|0|2")
        await browser.until_shown("Reconstruction of window 18")
        shown = [request.index for _, request in viewer.engine.requests if request.recording_id == "a"]
        assert shown[-3:] == list(range(shown[-3], shown[-3] + 3))
        await browser.use(browser.widget("Window"), 1)
        await browser.until_shown("window 1 of 0 – 29")
        await asyncio.sleep(0.5)
        assert "window 1 of 0 – 29" in browser.words()

    visit(viewer, story, tab=47)


def test_whoever_leaves_is_forgotten(viewer):
    before = len(viewer.engine.dropped)

    async def story(browser):
        return None

    visit(viewer, story, tab=48)
    ends = time.monotonic() + 10
    while len(viewer.engine.dropped) == before:
        assert time.monotonic() < ends
        time.sleep(0.05)


def test_help_opens_at_the_question_mark(viewer):
    async def story(browser):
        await browser.use(browser.widget("channel"), "key|question|5")
        await browser.until_shown('data-testid="help"')
        assert browser.notices == []

    visit(viewer, story, tab=49)


def test_a_slow_page_still_gets_its_view_back(viewer):
    kept = json.dumps({"recording_id": "a", "model_id": "m", "index": 8, "policy": {"kind": "BetweenFrames"}})

    async def story(browser):
        await browser.until_shown("window 0 of 0 – 29")
        await browser.use(browser.widget("channel"), "hello|50|1600|900|9")
        await browser.until_shown("window 8 of 0 – 29")

    visit(viewer, story, tab=None, storage={"view:a:50": kept})


def test_a_change_goes_into_the_request_and_out_of_it_again(viewer):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        channel = browser.widget("channel")
        await browser.use(channel, "pick|set:inspect.opened:change|0.5|0.5|0")
        await browser.use(channel, "pick|inspect:switch:tpa|0.5|0.5|1")
        await browser.use(channel, "pick|inspect:edit:drop:0.5|0.5|0.5|2")
        await browser.until(lambda: viewer.engine.requests[-1][1].edit.drop == 0.5)
        assert viewer.engine.requests[-1][1].intervention.without_context
        await browser.until(lambda: any(asked[1] == "inspect.outcome" and asked[2] for asked in viewer.engine.jobs))
        await browser.use(channel, "pick|inspect:reset|0.5|0.5|3")
        await browser.until(lambda: viewer.engine.requests[-1][1].is_original)
        await browser.until(lambda: viewer.engine.jobs[-1][1:] == ("inspect.outcome", None))

    visit(viewer, story, tab=51)


def test_closing_every_inspector_takes_its_questions_back(viewer):
    async def story(browser):
        await browser.until_shown("Reconstruction of window 0")
        viewer.engine.jobs.clear()
        channel = browser.widget("channel")
        await browser.use(channel, "pick|set:inspect.opened:matters|0.5|0.5|1")
        await browser.until(
            lambda: {asked[1] for asked in viewer.engine.jobs} == {"inspect.network", "inspect.matters"}
        )
        await browser.use(channel, "pick|set:inspect.opened:none|0.5|0.5|2")
        await browser.until(lambda: [asked[2] for asked in viewer.engine.jobs[2:]] == [None, None])
        await browser.until_shown("Choose a pixel")

    visit(viewer, story, tab=52)
