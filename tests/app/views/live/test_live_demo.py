"""A booth with a camera: the demo waits for its source, then runs on it, and nobody records."""

import asyncio
import itertools
import time
from threading import Event

import pytest

from app.catalogue.live import WaitingForEvents
from app.config import LiveConfig, ViewerConfig
from app.demo_check import check_demo
from app.main import Viewer
from app.session import rehearsal
from app.session.rehearsal import rehearse
from etnet.bundled import samples
from etnet.live.source import Packet
from tests.app.stand_ins import Browser
from tests.app.views.live.viewers import SENSOR, live_viewer, press, replayed
from tests.live.sources import wait_for
from tests.strategies import make_events


class Late:
    """A source that says nothing for a while, and nothing any more once it is `still`."""

    name, format, sensor = "Stand-in 7", "made up", SENSOR

    def __init__(self, silent_for):
        self.silent_for, self.replay, self.still = silent_for, replayed(), Event()

    def packets(self, is_stopped):
        until = time.monotonic() + self.silent_for
        while time.monotonic() < until and not is_stopped():
            time.sleep(0.02)
            yield Packet(make_events(0, SENSOR))
        yield from itertools.takewhile(lambda packet: not self.still.is_set(), self.replay.packets(is_stopped))
        while not is_stopped():
            time.sleep(0.02)
            yield Packet(make_events(0, SENSOR))

    def settings(self):
        return ()

    def change(self, name, value):
        raise AssertionError

    def close(self):
        self.replay.close()


def test_a_live_source_is_waited_for_before_the_doors_open_and_each_of_its_windows_is_another_one():
    told = []
    with live_viewer(Late(1.5), is_demo=True) as viewer:
        made = rehearse(viewer.engine, viewer.catalogue, viewer.default, lambda *done: told.append(done))
        assert made.num_images == rehearsal.LIVE_WINDOWS
        assert told == [(number + 1, rehearsal.LIVE_WINDOWS) for number in range(rehearsal.LIVE_WINDOWS)]
        assert made.step > 0
        assert len(viewer.feed.windows.kept) >= rehearsal.LIVE_WINDOWS


def test_a_scene_that_stays_still_is_said_in_words(monkeypatch):
    monkeypatch.setattr(rehearsal, "LIVE_PATIENCE", 0.5)
    with live_viewer(Late(60), is_demo=True) as viewer:
        with pytest.raises(WaitingForEvents, match="no events yet; move"):
            rehearse(viewer.engine, viewer.catalogue, viewer.default, lambda *done: None)
        waits = rehearse(viewer.engine, viewer.catalogue, viewer.default, lambda *done: None, may_be_silent=True)
        assert waits.num_images == 0


def test_a_scene_that_becomes_still_is_not_waited_for_for_ever(monkeypatch):
    source = Late(0)
    with live_viewer(source, is_demo=True) as viewer:
        wait_for(lambda: viewer.feed.windows is not None and len(viewer.feed.windows.kept) > 0)
        source.still.set()
        monkeypatch.setattr(rehearsal, "LIVE_PATIENCE", 1.0)
        made = rehearse(viewer.engine, viewer.catalogue, viewer.default, lambda *done: None)
        assert 0 < made.num_images < rehearsal.LIVE_WINDOWS


def test_the_whole_viewer_shows_a_live_source_in_public():
    source = LiveConfig(loop=True)
    config = ViewerConfig(
        port=0, threads=1, budget=256, downsample=4, demo=True, camera=False, live=str(samples()[0]), source=source
    )
    viewer = Viewer(config)

    async def visit():
        async with Browser.open(viewer.port) as browser:
            await browser.until_shown('data-act="events"', 120)
            await browser.until(lambda: viewer.newest_page() is not None and viewer.newest_page().ready is not None)
            page = viewer.newest_page()
            assert page.follows
            assert page.state.recording_id == viewer.live.id
            assert "live:record" not in browser.html()
            await press(browser, "live:record")
            await press(browser, "pixel", 0.5, 0.5)
            await browser.until(lambda: viewer.newest_page().state.query is not None)
            await browser.until(lambda: viewer.newest_page().ready.attention is not None)
            assert not viewer.newest_page().follows, "the moment that was touched stays"
            assert viewer.live.shown(None, False).recording is None

    try:
        viewer.rehearse()
        asyncio.run(visit())
        page, live = itertools.islice(check_demo(viewer, config), 2)
        assert page.is_good
        assert live.name == f"recording {viewer.live.live.source.name}"
        assert "images, " in live.words or "an image takes" in live.words
    finally:
        viewer.stop()
