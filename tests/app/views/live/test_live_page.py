"""A visitor of a live source: they follow it, go back while it goes on, click, return, record and open the file."""

import asyncio
import re

import numpy as np
import torch

from app.catalogue.cut import CutRecording
from etnet.events.open import open_recording
from etnet.live.buffer import Keep
from etnet.live.log import windows_as_cut
from etnet.reconstruction import reconstruct
from tests.app.stand_ins import Browser
from tests.app.views.live.viewers import MODEL, live_viewer, press, replayed


async def leave_for(browser, viewer, index):
    """Drag the slider back. It follows the source a little late, and viser drops a value that a widget has already."""
    slider = browser.widget("Window")
    await browser.until(lambda: browser.widgets[slider]["value"] > index)
    await browser.use(slider, index)
    await browser.until(lambda: is_at(viewer.page, index))


def is_at(page, index):
    return page.state.index == index and page.ready is not None and page.ready.request.index == index


def test_the_frames_that_are_shown_live_and_called_exact_are_those_of_the_recorded_file(tmp_path):
    path, shown = tmp_path / "live.aedat4", {}

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')

            def collected():
                ready = viewer.page.ready if viewer.page is not None else None
                if ready is not None and ready.is_exact and ready.request.recording_id == viewer.feed.id:
                    shown[ready.request.index] = ready.frame
                return len(shown)

            await browser.until(lambda: collected() >= 8)
            assert viewer.page.step_milliseconds > 0
            await leave_for(browser, viewer, 1)
            before = len(shown)
            await press(browser, "live:follow")
            await browser.until(lambda: collected() > before + 4)

    with live_viewer(record=path) as viewer:
        asyncio.run(visit(viewer))
    with open_recording(path) as recording:
        as_cut = windows_as_cut(recording)
        for window, step in reconstruct(MODEL, recording, as_cut.windows):
            if (frame := shown.pop(window.index, None)) is not None:
                assert torch.equal(step.frame[0, 0], torch.from_numpy(np.array(frame)))
    assert not shown


def test_going_back_leaves_the_source_and_back_to_live_returns_while_it_goes_on(tmp_path):
    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await browser.until(lambda: viewer.page.placed is not None and len(viewer.page.placed.windows) > 10)
            await leave_for(browser, viewer, 5)
            await browser.until_shown("Back to live")
            page = viewer.page
            await browser.until(lambda: len(viewer.feed.windows.kept) > len(page.placed.windows))
            assert viewer.page.state.index == 5
            await press(browser, "pixel", 0.25, 0.5)
            await browser.until(lambda: viewer.page.ready is not None and viewer.page.ready.attention is not None)
            assert viewer.page.state.query == (10, 14)
            assert viewer.page.ready.request.index == 5
            assert viewer.page.ready.is_exact
            await browser.until_shown("ago")
            await press(browser, "live:follow")
            await browser.until(lambda: viewer.page.follows and viewer.page.state.index > len(page.placed.windows))
            await browser.until(lambda: re.search(r">Live, [0-9.]+ m?s behind<", browser.html()))

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


def test_one_click_records_and_the_finished_file_opens_with_the_windows_as_they_were_cut(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await press(browser, "live:record")
            await browser.until_shown("Stop recording")
            num_before = len(viewer.feed.windows.kept)
            await browser.until(lambda: len(viewer.feed.windows.kept) > num_before + 3)
            await press(browser, "live:stop")
            await browser.until_shown("Open it")
            recorded = viewer.feed.files()[0]
            assert recorded.path.name in browser.html()
            await press(browser, f"open:{recorded.id}")
            await browser.until(
                lambda: viewer.page.state.recording_id == recorded.id and viewer.page.moment is not None
            )
            await browser.until(lambda: viewer.page.ready is not None and viewer.page.ready.is_exact)
            recording = viewer.page.moment.recording
            assert isinstance(recording, CutRecording)
            assert recording.num_events == recorded.num_events > 0
            assert list(viewer.page.moment.windows) == list(windows_as_cut(recording).windows)
            await browser.until_shown("Show live")

    with live_viewer() as viewer:
        asyncio.run(visit(viewer))


def test_what_has_left_the_buffer_is_said_and_never_another_window():
    source = replayed(speed=1.0, num_events=200_000)

    async def visit(viewer):
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-testid="is-live"')
            await press(browser, "goto:0")
            await browser.until(lambda: not viewer.page.follows and viewer.page.gone != "")
            assert viewer.page.moment is None
            assert viewer.page.state.index == 0
            assert viewer.page.placed.index == 0
            await browser.until(lambda: re.search(r"gone: before [0-9.]+ s", browser.html()))
            await press(browser, "live:follow")
            await browser.until(lambda: viewer.page.moment is not None and viewer.page.follows)

    with live_viewer(source, Keep(seconds=1.0)) as viewer:
        asyncio.run(visit(viewer))
