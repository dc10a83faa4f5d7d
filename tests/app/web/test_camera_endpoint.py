"""Where a camera comes in: only with a ticket, only frames of one size, one at a time."""

import asyncio
import contextlib
import json

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from app.catalogue import mirror as mirrors
from app.catalogue.mirror import SENSOR, Mirrors
from app.web import camera_endpoint, guarding
from app.web.camera_endpoint import PATH, CameraEndpoint
from app.web.server import Address, free_port, start_server


@contextlib.contextmanager
def serving():
    made = Mirrors(lambda recording_id, wait: None, lambda entry: None, lambda recording_id: None)
    port = free_port("127.0.0.1", 18_900)
    server = start_server(Address(), port, lambda client: None, None, {PATH: CameraEndpoint(made)})
    try:
        yield made, f"ws://127.0.0.1:{server.get_port()}{PATH}"
    finally:
        made.close()
        server.stop()


def run(story):
    async def visit():
        with serving() as (made, address):
            await story(made, address)

    asyncio.run(visit())


async def heard(socket):
    return json.loads(await asyncio.wait_for(socket.recv(), 5))


def frame(number=0):
    return np.full((SENSOR.height, SENSOR.width), 20 * number % 256, np.uint8).tobytes()


def test_frames_are_taken_one_at_a_time_and_sliders_in_between():
    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            assert await heard(socket) == {"go": [SENSOR.width, SENSOR.height]}
            for number in range(1, 5):
                await socket.send(frame(number))
                assert await heard(socket) == {"got": number}
                await socket.send(json.dumps({"contrast": 0.9, "noise": 1}))
                await socket.send('{"contrast": "much"}')
                await socket.send("nonsense")
                await asyncio.sleep(0.04)
            assert mirror.recording_id
            assert mirror._pixels._wanted[1] == 1.0
        for _ in range(100):
            if not mirror.recording_id:
                break
            await asyncio.sleep(0.02)
        assert mirror.recording_id == "", "the page has gone, and so has what it showed"

    run(story)


@pytest.mark.parametrize(
    "greeting", ["", "nonsense", "{}", '{"ticket": "guessed"}', '{"ticket": 5}', "[" * 400, "x" * 900]
)
def test_without_a_ticket_nothing_is_taken(greeting):
    async def story(made, address):
        made.mirror()
        async with connect(address) as socket:
            await socket.send(greeting)
            assert "load" in (await heard(socket))["refused"]
            with pytest.raises(ConnectionClosed):
                await socket.recv()

    run(story)


@pytest.mark.parametrize("size", [0, 1, SENSOR.num_pixels - 1, SENSOR.num_pixels + 1, 200_000])
def test_a_frame_of_another_size_ends_it(size):
    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            await heard(socket)
            await socket.send(bytes(size))
            assert f"{SENSOR.num_pixels:,}" in (await heard(socket))["refused"]

    run(story)


def test_a_mirror_ends_by_itself(monkeypatch):
    monkeypatch.setattr(mirrors, "LONGEST", 0.3)

    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            await heard(socket)
            said = {}
            while "over" not in said:
                await socket.send(frame())
                said = await heard(socket)

    run(story)


def test_a_camera_that_falls_silent_is_gone(monkeypatch):
    monkeypatch.setattr(camera_endpoint, "SILENCE", 0.1)

    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            await heard(socket)
            assert "no picture came" in (await heard(socket))["refused"]

    run(story)


def test_words_alone_do_not_keep_a_camera_on(monkeypatch):
    monkeypatch.setattr(camera_endpoint, "SILENCE", 0.3)

    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            await heard(socket)

            async def talk():
                with contextlib.suppress(ConnectionClosed):
                    while True:
                        await socket.send('{"contrast": 0.4, "noise": 0}')
                        await asyncio.sleep(0.02)

            talking = asyncio.create_task(talk())
            assert "no picture came" in (await heard(socket))["refused"]
            talking.cancel()

    run(story)


@pytest.mark.parametrize("last", ["leaves", "nonsense"])
def test_nobody_waits_while_a_camera_ends(last):
    ended = []

    async def story(made, address):
        mirror = made.mirror()
        end = mirror.end

        def end_and_tell(trouble=""):
            ended.append((asyncio._get_running_loop() is None, trouble))
            end(trouble)

        mirror.end = end_and_tell
        async with connect(address) as socket:
            await socket.send(json.dumps({"ticket": mirror.ticket}))
            await heard(socket)
            if last == "nonsense":
                await socket.send(b"")
                assert "wanted" in (await heard(socket))["refused"]
        for _ in range(500):
            if ended and mirror.recording_id == "":
                break
            await asyncio.sleep(0.02)
        (is_beside, trouble), *_ = ended
        assert is_beside, "the event loop, and so every page, would stand still"
        assert bool(trouble) == (last == "nonsense")

    run(story)


def test_one_more_than_there_is_room_for_is_told_so(monkeypatch):
    monkeypatch.setattr(CameraEndpoint, "most_connections", 1)

    async def story(made, address):
        mirror = made.mirror()
        async with connect(address) as first, connect(address) as second:
            await first.send(json.dumps({"ticket": mirror.ticket}))
            await heard(first)
            await second.send(json.dumps({"ticket": made.mirror().ticket}))
            assert "many cameras" in (await heard(second))["refused"]
        why = "many cameras"
        while "many cameras" in why:
            async with connect(address) as third:
                await third.send(json.dumps({"ticket": made.mirror().ticket}))
                why = (await heard(third)).get("refused", "")
        assert why == ""

    run(story)


def test_who_says_nothing_keeps_nobodys_camera_out(monkeypatch):
    monkeypatch.setattr(CameraEndpoint, "most_connections", 2)
    monkeypatch.setattr(guarding, "MOST_SOCKETS", 2)
    monkeypatch.setattr(guarding, "MOST_SILENT", 3)

    async def story(made, address):
        async with contextlib.AsyncExitStack() as stack:
            silent = [await stack.enter_async_context(connect(address)) for _ in range(5)]
            camera = await stack.enter_async_context(connect(address))
            await camera.send(json.dumps({"ticket": made.mirror().ticket}))
            assert await heard(camera) == {"go": [SENSOR.width, SENSOR.height]}
            for gone in silent[:2]:
                await asyncio.wait_for(gone.wait_closed(), 60)

    run(story)


def test_a_foreign_page_gets_no_camera_in():
    async def story(made, address):
        with pytest.raises(InvalidStatus):
            await connect(address, origin="http://elsewhere.example")

    run(story)
