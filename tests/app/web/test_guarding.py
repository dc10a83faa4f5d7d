"""Hostile pages over the real server: each ends alone, with a code and one line; nobody else's page notices."""

import asyncio
import contextlib
import logging
import socket
import time
from types import SimpleNamespace

import msgspec
import pytest
import viser
from websockets.asyncio.client import connect
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.web import guarded_connection, guarding
from app.web.bounded_log import BoundedHandler
from tests.app.stand_ins import Browser, served
from tests.app.web.fuzz_messages import CAMERA, frames

PROTOCOL = f"viser-v{viser.__version__}"


@pytest.fixture(scope="module")
def viewer():
    with served() as running:
        yield running


def asked(port, request, host=None):
    """What a raw request is answered, up to the end of the connection."""
    with socket.create_connection(("127.0.0.1", port), timeout=5) as link:
        link.sendall(request.replace(b"HOST", f"127.0.0.1:{port}".encode()))
        found = b""
        with contextlib.suppress(ConnectionResetError):
            while block := link.recv(65_536):
                found += block
        return found


def status_of(answer):
    return int(answer.split(b" ", 2)[1]) if answer else None


async def end_of(port, *frames_, origin=None):
    """The code by which a page is ended that sends these frames."""
    async with connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], max_size=None, origin=origin) as page:
        with contextlib.suppress(ConnectionClosed):
            for frame in frames_:
                await page.send(frame)
            async with asyncio.timeout(5):
                while True:
                    await page.recv()
        return page.close_code


def test_what_viser_would_broadcast_ends_its_sender_and_reaches_nobody(viewer):
    async def story():
        async with Browser.open(viewer.port, tab=31) as other:
            await other.until_shown("Reconstruction")
            heard = len(other.arrivals)
            dirty = msgspec.msgpack.encode({"type": "GuiFormDirtyMessage", "uuid": "x" * 200_000})
            for _ in range(3):
                assert await end_of(viewer.port, msgspec.msgpack.encode(CAMERA), dirty) == 1008
            await asyncio.sleep(0.2)
            assert "GuiFormDirtyMessage" not in {kind for _, kind, _ in other.arrivals[heard:]}
            await other.use(other.widget("Window"), 3)
            await other.until_shown("window 3 ")

    asyncio.run(story())


def test_a_page_that_does_not_say_where_it_looks_is_cut(viewer, monkeypatch):
    monkeypatch.setattr(guarding, "SILENCE", 0.3)
    began = time.monotonic()
    assert asyncio.run(end_of(viewer.port)) == 1008
    assert time.monotonic() - began < 4


@pytest.mark.parametrize("theirs", [f"{PROTOCOL}-other", "viser-v0.0.1", None])
def test_a_page_of_another_version_is_told_so_and_not_which_one_runs_here(viewer, theirs):
    async def story():
        subprotocols = None if theirs is None else [theirs]
        async with connect(f"ws://127.0.0.1:{viewer.port}", subprotocols=subprotocols) as page:
            with contextlib.suppress(ConnectionClosed):
                await asyncio.wait_for(page.recv(), 60)
            return page.close_code, page.close_reason

    code, reason = asyncio.run(story())
    assert code == 1002
    assert "load it again" in reason
    assert viser.__version__ not in reason


@pytest.mark.parametrize(
    ("peer", "behind_proxy", "forwarded", "address"),
    [
        ("10.0.0.7", False, ["1.2.3.4"], "10.0.0.7"),
        ("10.0.0.7", True, ["1.2.3.4"], "10.0.0.7"),  # no proxy of this machine
        ("127.0.0.1", False, ["1.2.3.4"], "127.0.0.1"),
        ("127.0.0.1", True, [], "127.0.0.1"),
        ("127.0.0.1", True, ["1.2.3.4"], "1.2.3.4"),
        ("::1", True, ["the visitor says 9.9.9.9, 1.2.3.4"], "1.2.3.4"),
        ("127.0.0.1", True, ["9.9.9.9", "8.8.8.8, 1.2.3.4"], "1.2.3.4"),
        ("127.0.0.1", True, ["x" * 5000], "x" * 64),
    ],
)
def test_an_address_is_the_peers_or_what_the_proxy_on_this_machine_saw_itself(peer, behind_proxy, forwarded, address):
    headers = Headers([("X-Forwarded-For", value) for value in forwarded])
    request = SimpleNamespace(headers=headers)
    assert guarding.address_of(SimpleNamespace(remote_address=(peer, 5)), request, behind_proxy) == address


def test_an_address_has_a_limit_of_pages(viewer, monkeypatch):
    monkeypatch.setattr(guarding, "MOST_SOCKETS", 2)

    async def story():
        async with Browser.open(viewer.port, tab=35) as one, Browser.open(viewer.port, tab=36) as other:
            for page in (one, other):
                await page.until(lambda page=page: len(page.widgets) > 20, 60)
            with pytest.raises(InvalidStatus) as refusal:
                await connect(f"ws://127.0.0.1:{viewer.port}", subprotocols=[PROTOCOL])
            assert refusal.value.response.status_code == 429
        ends = time.monotonic() + 60
        while True:  # they have gone: there is room again, once the server has noticed
            with contextlib.suppress(InvalidStatus):
                async with connect(f"ws://127.0.0.1:{viewer.port}", subprotocols=[PROTOCOL]):
                    return
            assert time.monotonic() < ends
            await asyncio.sleep(0.05)

    asyncio.run(story())


def test_sockets_that_say_nothing_keep_no_page_of_their_address_out(viewer, monkeypatch):
    monkeypatch.setattr(guarding, "MOST_SOCKETS", 3)
    monkeypatch.setattr(guarding, "MOST_SILENT", 3)

    async def story():
        async with contextlib.AsyncExitStack() as stack:
            silent = [
                await stack.enter_async_context(
                    connect(f"ws://127.0.0.1:{viewer.port}", subprotocols=[PROTOCOL], max_size=None)
                )
                for _ in range(5)
            ]
            async with Browser.open(viewer.port, tab=37) as page:
                await page.until_shown("Reconstruction", 60)
                for gone in silent[:3]:
                    await asyncio.wait_for(gone.wait_closed(), 60)
                await page.use(page.widget("Window"), 3)
                await page.until_shown("window 3 ", 60)

    asyncio.run(story())


def test_connections_of_one_address_do_not_take_all_files_of_the_process(monkeypatch):
    monkeypatch.setattr(guarded_connection, "MOST_CONNECTIONS", 5)
    with served() as viewer, contextlib.ExitStack() as stack:
        waiting = [
            stack.enter_context(socket.create_connection(("127.0.0.1", viewer.port), timeout=60)) for _ in range(8)
        ]
        for link in waiting[5:]:
            with contextlib.suppress(ConnectionResetError):
                assert link.recv(1) == b""
        for link in waiting[:5]:
            link.close()
        ends = time.monotonic() + 60
        while not (answer := _asked_or_cut(viewer.port)):
            assert time.monotonic() < ends
            time.sleep(0.05)
        assert status_of(answer) == 200


def _asked_or_cut(port):
    with contextlib.suppress(ConnectionResetError, BrokenPipeError):
        return asked(port, b"GET /healthz HTTP/1.1\r\nHost: HOST\r\n\r\n")
    return b""


PING, PONG, EMPTY, WORD = b"\x89\x80", b"\x8a\x80", b"\x00\x80", b"\x00\x81"


@pytest.mark.parametrize(
    ("first", "frame"),
    [(b"", PING + bytes(4)), (b"", PONG + bytes(4)), (b"\x02\x80" + bytes(4), EMPTY + bytes(4)),
     (b"\x02\x80" + bytes(4), WORD + bytes(5))],
)  # fmt: skip
def test_frames_without_a_message_end_their_connection(viewer, first, frame):
    ask = [
        "GET / HTTP/1.1", f"Host: 127.0.0.1:{viewer.port}", "Upgrade: websocket", "Connection: Upgrade",
        "Sec-WebSocket-Key: MDEyMzQ1Njc4OTAxMjM0NQ==", "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Protocol: {PROTOCOL}", "", "",
    ]  # fmt: skip
    with socket.create_connection(("127.0.0.1", viewer.port), timeout=60) as link:
        link.sendall("\r\n".join(ask).encode())
        found = b""
        while b"\r\n\r\n" not in found:
            found += link.recv(1)
        assert status_of(found) == 101
        with contextlib.suppress(ConnectionResetError, BrokenPipeError):
            link.sendall(first + frame * 20_000)
            while link.recv(65_536):
                pass


async def moved(page, *indices):
    """Seconds until each of these windows is on the page."""
    took = []
    for index in indices:
        began = time.monotonic()
        await page.use(page.widget("Window"), index)
        await page.until_shown(f"window {index} ")
        took.append(time.monotonic() - began)
    return took


def test_a_flood_of_one_page_does_not_hold_up_another(viewer):
    async def story():
        async with Browser.open(viewer.port, tab=33) as other, Browser.open(viewer.port, tab=34) as flood:
            await other.until_shown("Reconstruction")
            await flood.until_shown("Reconstruction")
            slider = flood.widget("Window")
            alone = await moved(other, 3, 8, 13, 18, 23)

            async def send():
                with contextlib.suppress(ConnectionClosed):
                    for i in range(20_000):
                        await flood.use(slider, i % 29)

            sending = asyncio.create_task(send())
            beside = await moved(other, 4, 9, 14, 19, 24)
            sending.cancel()
            assert sorted(beside)[2] < 1.5
            # The first one waits for the burst that a page may send at once, and for this very process to send it.
            assert sorted(beside)[3] < 0.3 + 5 * sorted(alone)[2]

    asyncio.run(story())


def fuzz(viewer, count, seed):
    """Frames at the real server, a new page after each that is cut off; records of warnings and worse, frames sent."""
    records, num_sent = [], 0
    handler = logging.Handler(logging.WARNING)
    handler.emit = records.append
    logging.getLogger().addHandler(handler)

    async def story():
        async with Browser.open(viewer.port, tab=32) as other:
            await other.until_shown("Reconstruction")
            uuids = tuple(other.widgets)[:40]
            waiting, num_refused = frames(count, seed, uuids), 0
            while num_sent < count:
                before = num_sent
                await page(waiting)
                num_refused = num_refused + 1 if num_sent == before else 0
                assert num_refused < 50, "no page is let in any more"
            await other.use(other.widget("Window"), 7)
            await other.until_shown("window 7 ")

    async def page(waiting):
        nonlocal num_sent
        with contextlib.suppress(ConnectionClosed, InvalidStatus):
            async with Browser.open(viewer.port, tab=None) as hostile:
                await hostile.until(lambda: len(hostile.widgets) > 20)
                mine = tuple(hostile.widgets)
                for frame in waiting:
                    num_sent += 1
                    if isinstance(frame, bytes) and b"GuiUpdateMessage" in frame and num_sent % 2:
                        content = {"type": "GuiUpdateMessage", "uuid": mine[num_sent % len(mine)]}
                        frame = msgspec.msgpack.encode({**content, "updates": {"value": num_sent}})
                    await hostile._socket.send(frame)
                    if num_sent % 5 == 0:
                        await asyncio.sleep(0)
                await asyncio.sleep(0.3)

    try:
        asyncio.run(story())
    finally:
        logging.getLogger().removeHandler(handler)
    return records, num_sent


# A page that ends while it is drawn is what happens here; the viewer says nothing of it, either (`app.main`).
@pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection:UserWarning")
def test_hostile_frames_make_no_traceback_and_end_nobody_else(viewer):
    records, num_sent = fuzz(viewer, 300, seed=3)
    assert num_sent == 300
    assert [record.getMessage() for record in records if record.exc_info] == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection:UserWarning")
def test_many_hostile_frames_make_no_traceback_and_end_nobody_else(viewer):
    records, num_sent = fuzz(viewer, 10_000, seed=4)
    assert num_sent == 10_000
    assert [record.getMessage() for record in records if record.exc_info] == []


@pytest.mark.parametrize("method", ["POST", "PUT", "HEAD", "OPTIONS", "DELETE"])
def test_other_methods_are_405(viewer, method):
    answer = asked(viewer.port, f"{method} / HTTP/1.1\r\nHost: HOST\r\n\r\n".encode())
    assert status_of(answer) == 405
    assert b"Allow: GET" in answer


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET //[ HTTP/1.1\r\nHost: HOST\r\n\r\n", 404),
        (b"GET http://[ HTTP/1.1\r\nHost: HOST\r\n\r\n", 400),
        (b"GET /" + b"a" * 7000 + b" HTTP/1.1\r\nHost: HOST\r\n\r\n", 404),
        (b"GET /static/" + b"a" * 5000 + b" HTTP/1.1\r\nHost: HOST\r\n\r\n", 404),
        (b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\nHost: HOST\r\n\r\n", 431),
        (b"GET / HTTP/1.1\r\nHost: HOST\r\nHost: HOST\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: HOST\r\nUpgrade: websocket\r\nUpgrade: websocket\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: HOST\r\nAccept-Encoding: a\r\nAccept-Encoding: b\r\n\r\n", 404),
        (b"GET / HTTP/1.0\r\nHost: HOST\r\n\r\n", 400),
        (b"GET / HTTP/1.1\r\nHost: HOST\r\nbroken\r\n\r\n", 400),
        (b"GET /%00 HTTP/1.1\r\nHost: HOST\r\n\r\n", 404),
        (b"GET /\xff\xfe HTTP/1.1\r\nHost: HOST\r\n\r\n", 404),
        (b"\x16\x03\x01\x02\x00\x01\x00", 400),
        (b"GET / HTTP/1.1\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: HOST.evil.example\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: HOST, evil.example\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: user@HOST\r\n\r\n", 421),
        (b"GET / HTTP/1.1\r\nHost: evil.example\r\nX-Forwarded-Host: HOST\r\n\r\n", 421),
    ],
)
def test_a_request_that_no_browser_sends_is_answered_with_a_4xx(viewer, request_, status):
    assert status_of(asked(viewer.port, request_)) == status


@pytest.mark.parametrize("path", ["/", "/healthz", "/static/logo.svg", "/none", "/static/none"])
def test_every_answer_carries_its_headers_and_names_no_version(viewer, path):
    answer = asked(viewer.port, f"GET {path} HTTP/1.1\r\nHost: HOST\r\n\r\n".encode()).split(b"\r\n\r\n")[0].lower()
    for header in (
        b"x-content-type-options: nosniff", b"referrer-policy: no-referrer", b"frame-ancestors 'self'",
        b"cross-origin-opener-policy: same-origin",
    ):  # fmt: skip
        assert header in answer
    assert b"server:" not in answer


def test_a_port_check_prints_nothing_and_a_flood_of_errors_a_line_a_minute(viewer):
    class Stream:
        lines = ""

        def write(self, text):
            self.lines += text

        def flush(self):
            pass

    stream, now = Stream(), [0.0]
    handler = BoundedHandler(stream, lambda: now[0])
    logging.getLogger().addHandler(handler)
    try:
        for _ in range(5):
            socket.create_connection(("127.0.0.1", viewer.port)).close()
        time.sleep(0.2)
        assert stream.lines == ""
        for second in range(120):
            now[0] = float(second)
            try:
                raise KeyError("\ud800\n" * 300)
            except KeyError:
                logging.getLogger("app.x").exception("a callback failed")
        assert len(stream.lines.splitlines()) == 2
        assert max(map(len, stream.lines.splitlines())) < 600
        assert "59 more" in stream.lines
        assert "test_guarding.py:" in stream.lines
    finally:
        logging.getLogger().removeHandler(handler)
