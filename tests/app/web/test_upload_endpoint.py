"""Files over the real server: what the door takes, what it cuts off, and what viser is never given to hold."""

import asyncio
import contextlib
import json
import time

import msgspec
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.catalogue.uploads import UploadLimits
from app.web.guarding import LARGEST_MESSAGE
from app.web.upload_endpoint import CHUNK, UploadEndpoint
from tests.app.stand_ins import Browser, held_files, served

LIMITS = UploadLimits(visitor_bytes=1_000_000, total_bytes=2_000_000)


@pytest.fixture(scope="module")
def viewer():
    with served(limits=LIMITS) as running:
        yield running


class Sender:
    """A page's end of the door."""

    def __init__(self, socket):
        self.socket = socket

    @classmethod
    @contextlib.asynccontextmanager
    async def open(cls, viewer, **more):
        async with connect(f"ws://127.0.0.1:{viewer.port}/upload", compression=None, **more) as socket:
            yield cls(socket)

    async def greet(self, **said):
        await self.socket.send(json.dumps(said))
        return await self.hear()

    async def hear(self):
        return json.loads(await asyncio.wait_for(self.socket.recv(), 10))

    async def until_over(self):
        """What was said before the connection ended."""
        heard = []
        with contextlib.suppress(ConnectionClosed):
            while True:
                heard.append(await self.hear())
        return heard


def ticket_of(browser):
    return browser.html().split('data-etv-ticket="')[1].split('"')[0]


def story(viewer, tell, tab=41):
    async def run():
        async with Browser.open(viewer.port, tab=tab) as browser:
            await browser.until_shown("Reconstruction of window 0")
            await browser.use(browser.widget("channel"), "pick|tab:recording|0|0|1")
            return await tell(browser, ticket_of(browser))

    return asyncio.run(run())


async def settled(condition):
    ends = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < ends
        await asyncio.sleep(0.01)


def test_a_file_goes_up_is_opened_and_goes_with_its_visitor(viewer):
    async def tell(browser, ticket):
        content = bytes(range(256)) * 2000
        async with Sender.open(viewer) as sender:
            assert await sender.greet(ticket=ticket, name="mine.raw", size=len(content)) == {"go": CHUNK}
            for start in range(0, len(content), CHUNK):
                await sender.socket.send(content[start : start + CHUNK])
                assert await sender.hear() == {"got": min(start + CHUNK, len(content))}
            await sender.socket.send("end")
            arrived = (await sender.hear())["done"]
        assert viewer.shelf.private[arrived].path.read_bytes() == content
        await browser.until(lambda: browser.widgets[browser.widget("Recording")]["value"] == "mine.raw")
        await browser.until_shown('data-k="remove:')
        async with Browser.open(viewer.port, tab=42) as other:
            await other.until_shown("Reconstruction of window 0")
            assert "mine.raw" not in other.html()
            assert "mine.raw" not in str(other.widgets[other.widget("Recording")]["options"])
            viewer.engine.requests.clear()
            await other.use(other.widget("channel"), f"pick|open:{arrived}|0|0|77")
            await other.until(lambda: other.notices)
            assert "not in the catalogue" in str(other.notices[-1])
            assert arrived not in str(viewer.engine.requests)

    story(viewer, tell)
    asyncio.run(settled(lambda: viewer.shelf.private == {} and held_files(viewer.uploads) == []))


def test_a_removed_file_leaves_the_page_on_another_recording(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="mine.raw", size=3)
            await sender.socket.send(b"abc")
            await sender.hear()
            await sender.socket.send("end")
            arrived = (await sender.hear())["done"]
        await browser.until(lambda: browser.widgets[browser.widget("Recording")]["value"] == "mine.raw")
        await browser.use(browser.widget("channel"), f"pick|remove:{arrived}|0|0|5")
        await browser.until(lambda: browser.widgets[browser.widget("Recording")]["value"] == "recording a")
        assert held_files(viewer.uploads) == []

    story(viewer, tell)


def test_messages_without_bytes_do_not_keep_a_transfer_waiting(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="a.raw", size=1000)
            await sender.socket.send(b"")
            assert "without bytes" in (await sender.hear())["refused"]
            assert await sender.until_over() == []
        await settled(lambda: held_files(viewer.uploads) == [])

    story(viewer, tell)


def test_who_says_nothing_keeps_nobodys_file_out(viewer, monkeypatch):
    monkeypatch.setattr(UploadEndpoint, "most_connections", 1)

    async def tell(browser, ticket):
        async with Sender.open(viewer), Sender.open(viewer), Sender.open(viewer) as sender:
            assert await sender.greet(ticket=ticket, name="a.raw", size=1000) == {"go": CHUNK}
        await settled(lambda: held_files(viewer.uploads) == [])

    story(viewer, tell)


def test_what_says_it_is_too_large_is_refused_before_a_byte_is_taken(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            assert "--data FOLDER" in (await sender.greet(ticket=ticket, name="a.raw", size=1_000_001))["refused"]
            assert await sender.until_over() == []
        await browser.until_shown("this viewer takes")
        assert held_files(viewer.uploads) == []

    story(viewer, tell)


def test_what_sends_more_than_it_said_is_cut_off(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="a.raw", size=1000)
            with contextlib.suppress(ConnectionClosed):
                for _ in range(50):
                    await sender.socket.send(bytes(600))
            heard = await sender.until_over()
        assert heard[0] == {"got": 600}
        assert "more came than the 1,000 bytes" in heard[1]["refused"]
        await browser.until_shown("more came than the 1,000 bytes")
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="b.raw", size=600)
            await sender.socket.send(bytes(600))
            await sender.socket.send(b"one more")
            assert "more came" in (await sender.until_over())[-1]["refused"]
        await settled(lambda: held_files(viewer.uploads) == [])

    story(viewer, tell)


def test_a_message_too_large_to_hold_ends_the_connection(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="a.raw", size=900_000)
            with contextlib.suppress(ConnectionClosed):
                await sender.socket.send(bytes(LARGEST_MESSAGE + 1))
            await sender.until_over()
            assert sender.socket.close_code == 1009
        await browser.until_shown("was cut off")
        await settled(lambda: held_files(viewer.uploads) == [])

    story(viewer, tell)


def test_a_cut_connection_leaves_nothing(viewer):
    async def tell(browser, ticket):
        async with Sender.open(viewer) as sender:
            await sender.greet(ticket=ticket, name="a.raw", size=1000)
            await sender.socket.send(bytes(500))
            await sender.hear()
            assert len(held_files(viewer.uploads)) == 1
            sender.socket.transport.abort()
        await browser.until_shown("was cut off; send it again")
        await settled(lambda: held_files(viewer.uploads) == [])

    story(viewer, tell)


def test_a_visitor_who_leaves_in_the_middle_leaves_nothing(viewer):
    async def run():
        async with Browser.open(viewer.port, tab=43) as browser:
            await browser.until_shown("Reconstruction of window 0")
            sending = Sender.open(viewer)
            sender = await sending.__aenter__()
            await sender.greet(ticket=ticket_of(browser), name="a.raw", size=1000)
            await sender.socket.send(bytes(500))
            await sender.hear()
        await settled(lambda: held_files(viewer.uploads) == [])
        await sender.socket.send(bytes(100))
        assert "has gone" in (await sender.until_over())[-1]["refused"]
        await sending.__aexit__(None, None, None)

    asyncio.run(run())


def test_nobody_sends_without_a_pages_ticket_and_nonsense_is_refused(viewer):
    async def tell(browser, ticket):
        for text in (
            json.dumps({"ticket": "x" * 24, "name": "a", "size": 3}),
            json.dumps({"ticket": ticket, "name": "a", "size": "many"}),
            json.dumps({"ticket": ticket, "name": "a", "size": 1e400}),
            json.dumps({"ticket": ticket, "name": "a", "size": "1" + "0" * 400}),
            json.dumps([1]),
            "[" * 4000,
            "{",
            "x" * 5000,
            b"bytes",
        ):
            async with Sender.open(viewer) as sender:
                await sender.socket.send(text)
                assert list(await sender.hear()) == ["refused"]
        async with Sender.open(viewer) as sender:
            assert list(await sender.greet(ticket=ticket, name="a", size=-5)) == ["refused"]
        with pytest.raises(InvalidStatus):
            async with Sender.open(viewer, origin="http://evil.example"):
                pass
        assert held_files(viewer.uploads) == []

    story(viewer, tell)


def test_viser_is_given_no_file_to_hold_and_no_message_that_is_large(viewer):
    """viser takes a file in the name of any widget, into memory and without a cap: the guard ends who tries."""

    async def tell(browser, ticket):
        slider = browser.widget("Window")
        start = {
            "type": "FileTransferStartUpload", "source_component_uuid": slider, "transfer_uuid": "t", "filename": "f",
            "mime_type": "", "part_count": 2, "size_bytes": 10,
        }  # fmt: skip
        await browser._send(start)
        with contextlib.suppress(ConnectionClosed):
            await browser._socket.wait_closed()
        assert browser._socket.close_code == 1008
        session = next(reversed(viewer.sessions.values()))
        assert session._client.gui._current_file_upload_states == {}

    story(viewer, tell)

    async def tell_much(browser, ticket):
        with contextlib.suppress(ConnectionClosed):
            await browser._socket.send(msgspec.msgpack.encode({"type": "x" * (LARGEST_MESSAGE + 1)}))
            await browser._socket.wait_closed()
        assert browser._socket.close_code == 1009

    story(viewer, tell_much)


def test_where_nothing_is_taken_there_is_no_door_and_no_button():
    with served() as closed:

        async def run():
            async with Browser.open(closed.port, tab=44) as browser:
                await browser.until_shown("Reconstruction of window 0")
                assert "data-etv-upload" not in browser.html()
                assert "data-etv-ticket" not in browser.html()
            async with Sender.open(closed) as sender:
                with pytest.raises(ConnectionClosed):
                    await sender.greet(ticket="t", name="a", size=3)

        asyncio.run(run())
