"""A page that has gone while it waited for a worker is not laid out."""

import asyncio
import threading
from types import SimpleNamespace

import msgspec
import viser
from websockets.asyncio.client import connect

from app.web.server import Address, free_port, start_server
from tests.app.catalogue.test_videos import until
from tests.app.web.fuzz_messages import CAMERA


def test_pages_that_have_left_before_their_turn_are_not_built(monkeypatch):
    visited, came, ended, is_free = [], [], [], threading.Event()

    async def to_thread(work, *given):
        came.append(given)
        while not is_free.is_set():
            await asyncio.sleep(0.01)
        ended.append(work(*given))

    monkeypatch.setattr("app.web.server.asyncio", SimpleNamespace(to_thread=to_thread))
    server = start_server(Address(), free_port("127.0.0.1", 18_800), visited.append)

    async def come_and_go():
        address = f"ws://127.0.0.1:{server.get_port()}"
        async with connect(address, subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as page:
            await page.send(msgspec.msgpack.encode(CAMERA))
            await asyncio.to_thread(until, lambda: len(came) == 1)

    try:
        asyncio.run(come_and_go())
        until(lambda: server.get_clients() == {})
        is_free.set()
        until(lambda: ended)
        assert visited == []
    finally:
        server.stop()
