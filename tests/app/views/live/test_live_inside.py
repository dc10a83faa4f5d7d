"""What works on a recording works on the last minute of a camera: pins, comparison, export, a link to a moment."""

import asyncio
import csv
import io
import re

import cv2
import numpy as np
import pytest
import torch

from app.engine.jobs import JobResult
from app.engine.requests import FrameRequest
from app.state.link import to_link
from app.views.attention.jobs.time import PinJob
from app.views.attention.state import PinnedMap
from app.views.compare.state import AddRun, StartCold
from app.views.export.state import EXPORT_SLOT, StartExport
from etnet.inspection.pins import pin
from etnet.live.buffer import Keep
from etnet.playback.playback import Playback
from tests.app.fakes import Notes
from tests.app.stand_ins import Browser
from tests.app.views.live.viewers import MODEL, live_viewer, press, replayed
from tests.live.sources import wait_for

SITE = "scale1.encoder.0.self"


async def follows(browser, viewer, num_windows=10):
    """Until the page shows a source of which so many windows were cut."""
    await browser.until_shown('data-testid="is-live"')
    await browser.until(lambda: viewer.page.placed is not None and len(viewer.page.placed.windows) > num_windows)


async def go_back(browser, viewer, index):
    """To a window of the past, whose image is there with what the chosen pixel looks at."""
    session = next(iter(viewer.sessions.values()))
    # A moment past the last window that a page knows is the newest one.
    await browser.until(lambda: len(viewer.page.placed.windows) > index + 1)
    moment = viewer.feed.windows.kept[index].t_stop - viewer.feed.live.extent().first_stamp
    await press(browser, f"goto:{moment / 1e6:.6f}")
    await browser.until(lambda: not viewer.page.follows and viewer.page.state.index == index)
    await press(browser, "pixel", 0.25, 0.5)
    await browser.until(lambda: viewer.page.ready is not None and viewer.page.ready.attention is not None)
    await browser.until(lambda: viewer.page.ready is not None and viewer.page.ready.request.index == index)
    return session


def test_a_map_of_the_past_is_pinned_and_the_present_is_held_against_it():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer)
            await press(browser, "workspace:attention")
            await go_back(browser, viewer, 5)
            await press(browser, "attention:pin:a")
            await browser.until_shown("now and A share 100 % of their weight")
            await press(browser, "live:follow")
            await browser.until(lambda: viewer.page.follows and viewer.page.state.index > 8)
            await browser.until(lambda: re.search(r"now and A share \d?\d % of their weight", browser.words()))
            then = viewer.page.results["attention.pin"].value.pin
            assert then.index == 5
            recording = viewer.feed.recording()
            query, site = viewer.page.state.query, viewer.page.results["attention.pin"].job.pinned.site
            plain = pin(Playback(MODEL, recording, recording.cut), 5, query, site, "mean")
            assert torch.equal(then.map, plain.map)

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


def test_a_pin_stays_when_its_moment_has_left_the_buffer_and_one_that_comes_too_late_says_so():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer, 3)
            await press(browser, "workspace:attention")
            index = len(viewer.feed.windows.kept) - 2
            await go_back(browser, viewer, index)
            await press(browser, "attention:pin:a")
            await browser.until_shown("now and A share 100 % of their weight")
            pinned = viewer.page.results["attention.pin"].job.pinned
            await press(browser, "live:follow")
            await browser.until(lambda: viewer.feed.recording().is_gone(viewer.feed.windows.kept[index]))
            shown = lambda: -1 if viewer.page.ready is None else viewer.page.ready.request.index  # noqa: E731
            await browser.until(lambda: viewer.page.follows and shown() > index + 3)
            await browser.until(lambda: re.search(r"now and A share \d?\d % of their weight", browser.words()))
            assert f"window {index}" in browser.words()
            return pinned

    with live_viewer(replayed(num_events=200_000), Keep(seconds=8.0)) as viewer:
        pinned = asyncio.run(visit(viewer))
        other = PinnedMap(pinned.request, SITE, None, "max", pinned.direction, pinned.query)
        notes = Notes()
        viewer.engine.job("somebody", "pin", PinJob(other), notes)
        trouble = notes.wait(lambda reply: reply[1].trouble)[1].trouble
        assert "gone: what came before" in trouble


def test_a_question_about_now_is_answered_by_a_network_that_was_not_asked_for_longer_than_is_held():
    with live_viewer(replayed(num_events=200_000), Keep(seconds=1.0)) as viewer:
        other = next(entry.id for entry in viewer.catalogue.models() if entry.id != "etnet-half")

        def asked() -> JobResult:
            wait_for(lambda: viewer.feed.windows is not None and len(viewer.feed.windows.kept) > 3)
            index, policy = len(viewer.feed.windows.kept) - 1, viewer.feed.windows.policy
            request = FrameRequest(viewer.feed.id, other, "fp32", policy, index)
            notes = Notes()
            pinned = PinnedMap(request, SITE, None, "mean", "attends to", (10, 14))
            viewer.engine.job("somebody", "pin", PinJob(pinned), notes)
            return notes.wait(lambda reply: reply[1].trouble or reply[1].is_whole)[1]

        first = asked()
        assert first.trouble == ""
        window = viewer.feed.windows.kept[first.value.pin.index]
        wait_for(lambda: viewer.feed.recording().is_gone(window))
        again = asked()
        assert again.trouble == ""
        assert again.value.pin.index > first.value.pin.index


def test_the_past_is_compared_by_another_network_and_a_cold_start_is_refused_in_words():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer)
            session = await go_back(browser, viewer, 6)
            await press(browser, "workspace:compare")
            session._speak(AddRun())
            await browser.until_shown("Run B: window 6")
            await press(browser, "live:follow")
            await browser.until(lambda: viewer.page.follows and viewer.page.state.index > 9)
            await browser.until(lambda: re.search(r"Run B: window \d\d", browser.html()))
            await go_back(browser, viewer, 7)
            session._speak(StartCold(1, True))
            await browser.until_shown("A run from a cold start needs a whole recording: record, and open the file.")

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


@pytest.mark.parametrize("is_followed", [False, True])
def test_files_are_made_of_a_moment_and_a_stretch_that_are_held_while_the_source_goes_on(is_followed):
    async def made(browser, viewer, session, order):
        session._speak(order)
        await browser.until(lambda: any(kind == "FileTransferPart" for _, kind, _ in browser.arrivals))
        parts = [message["content"] for _, kind, message in browser.arrivals if kind == "FileTransferPart"]
        browser.arrivals.clear()
        await browser.until(lambda: EXPORT_SLOT not in viewer.page.results)
        return b"".join(parts)

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer)
            session = await go_back(browser, viewer, 5)
            if is_followed:
                await press(browser, "live:follow")
                await browser.until(lambda: viewer.page.follows)
            else:
                picture = await made(browser, viewer, session, StartExport("png", panels=("reconstruction",), scale=1))
                assert cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR) is not None
            table = await made(browser, viewer, session, StartExport("csv", 2, 5))
            rows = list(csv.DictReader(io.StringIO(table.decode())))
            kept = [viewer.feed.windows.kept[index] for index in range(2, 6)]
            assert [int(row["num_events"]) for row in rows] == [window.num_events for window in kept]
            assert [int(row["t_stop_us"]) for row in rows] == [window.t_stop for window in kept]

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


def test_a_link_leads_to_its_moment_while_it_is_held_and_says_so_when_it_is_not():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer, 3)
            index = len(viewer.feed.windows.kept) - 2
            await go_back(browser, viewer, index)
            await browser.until(lambda: viewer.page.link != "")
            link = viewer.page.link
        async with Browser.open(viewer.port, tab=8) as browser:
            await browser.until_shown('data-testid="strip"')
            await browser.use(browser.widget("channel"), f"link|{link}")
            await browser.until(lambda: viewer.page is not None and viewer.page.state.index == index)
            assert not viewer.page.follows
            await browser.until_shown('data-testid="gone"')  # the tab says "gone: before" of what lay before it, too
            assert "gone: before" in browser.html()
            assert viewer.page.moment is None
            assert viewer.page.state.index == index

    with live_viewer(replayed(num_events=200_000), Keep(seconds=12.0)) as viewer:
        asyncio.run(visit(viewer))


def test_a_link_to_a_viewer_that_has_ended_is_one_sentence():
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await follows(browser, viewer, 3)
            session = next(iter(viewer.sessions.values()))
            link = to_link(type(session._state)("live-0badcafe", session._state.model_id), 1_000_000)
            await browser.use(browser.widget("channel"), f"link|{link}")
            await browser.until(lambda: any("by a viewer that has ended" in str(n) for n in browser.notices))
            await browser.until(lambda: viewer.page.follows)

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))
