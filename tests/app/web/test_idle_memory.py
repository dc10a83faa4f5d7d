"""What is left of visitors who have gone: nothing."""

import asyncio
import gc
import time
import weakref

from app.web.idle_memory import IdleMemory, give_back
from tests.app.stand_ins import Browser, served


def test_a_page_that_was_left_is_gone_with_all_it_held():
    with served() as viewer:

        async def visit():
            async with Browser.open(viewer.port) as browser:
                await browser.until_shown("Reconstruction of window 0")
                await browser.use(browser.widget("Window"), 22)
                await browser.until_shown("Reconstruction of window 22")

        held = []
        for _ in range(3):
            asyncio.run(visit())
            _, session = viewer.sessions.popitem()
            held += [weakref.ref(session), weakref.ref(session._client)]
            del session
        ends = time.monotonic() + 10
        while any(gone() is not None for gone in held) and time.monotonic() < ends:
            time.sleep(0.05)
            gc.collect()
        assert [gone() for gone in held] == [None] * 6


def test_what_refers_to_itself_is_given_back():
    class Page:
        def __init__(self):
            self.callback = self.close

        def close(self):
            pass

    gc.disable()
    try:
        gone = weakref.ref(Page())
        assert gone() is not None
        give_back()
        assert gone() is None
    finally:
        gc.enable()


def test_every_leaving_is_followed_by_a_sweep_and_a_crowd_by_few():
    swept, left = [], []

    async def evening():
        upkeep = IdleMemory(lambda: swept.append(time.monotonic()), settle=0.02, between=0.2)
        for pause in (0.0, 0.0, 0.05, 0.05, 0.3, 0.0, 0.0, 0.0):
            await asyncio.sleep(pause)
            left.append(time.monotonic())
            upkeep.after_visit()
        while not swept or swept[-1] < left[-1]:
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(evening(), 5))
    assert 2 <= len(swept) <= 4
    assert all(any(sweep >= leaving + 0.02 for sweep in swept) for leaving in left)


def test_after_a_visit_the_server_sweeps(monkeypatch):
    swept = []
    monkeypatch.setattr(
        "app.web.server.IdleMemory", lambda: IdleMemory(lambda: swept.append(1), settle=0.0, between=0.0)
    )
    with served() as viewer:

        async def visit():
            async with Browser.open(viewer.port) as browser:
                await browser.until_shown('data-testid="timeline"')

        asyncio.run(visit())
        ends = time.monotonic() + 5
        while not swept and time.monotonic() < ends:
            time.sleep(0.01)
    assert swept


def test_while_anybody_is_here_what_was_freed_is_given_back_now_and_then():
    trimmed, here = [], [True]

    async def evening():
        upkeep = IdleMemory(lambda: None, trim=lambda: trimmed.append(1), trim_every=0.02)
        for _ in range(5):
            upkeep.while_here(lambda: here[0])  # many come, one clock runs
        while len(trimmed) < 3:
            await asyncio.sleep(0.01)
        here[0] = False
        while upkeep._trims:  # the clock stops by itself
            await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(evening(), 60))
