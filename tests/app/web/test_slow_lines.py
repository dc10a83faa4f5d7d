"""Answers over a slow line come to their end; who asks for nothing is still ended in time."""

import asyncio
import contextlib
import socket
import time

import pytest
import websockets.asyncio.server as websocket_server
from websockets.exceptions import ConnectionClosed

from app.web import guarded_connection, guarding
from app.web.access import AccessControl, answer
from app.web.guarding import guarding as guarded

BODY = bytes(range(256)) * 800


def over_a_slow_line(tmp_path, visit):
    """What `visit` gives, called beside a guarded server with its port; neither end of the line holds much."""

    def process(connection, request):
        connection.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        return answer(200, BODY)

    async def handle(connection):
        with contextlib.suppress(ConnectionClosed):
            await connection.recv()

    async def story():
        with guarded(AccessControl(tmp_path)):
            server = await websocket_server.serve(handle, "127.0.0.1", 0, process_request=process)
        try:
            return await asyncio.to_thread(visit, server.sockets[0].getsockname()[1])
        finally:
            server.close()
            await server.wait_closed()

    return asyncio.run(story())


def line(port):
    link = socket.socket()
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    link.settimeout(60)
    link.connect(("127.0.0.1", port))
    return link


def test_the_last_bytes_come_over_a_slow_line_too(tmp_path, monkeypatch):
    monkeypatch.setattr(guarding, "CLOSING", 0.1)
    monkeypatch.setattr(guarded_connection, "ASKED", 0.3)

    def visit(port):
        with line(port) as link:
            began = time.monotonic()
            link.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            found = b""
            with contextlib.suppress(ConnectionResetError):
                while block := link.recv(2048):
                    found += block
                    time.sleep(0.01)
            return found, time.monotonic() - began

    found, took = over_a_slow_line(tmp_path, visit)
    assert took > 0.5
    assert found.split(b"\r\n\r\n", 1)[1] == BODY


@pytest.mark.parametrize("begun", [b"", b"GET / HTTP/1.1\r\nHost: "])
def test_who_asks_for_nothing_is_ended(tmp_path, monkeypatch, begun):
    monkeypatch.setattr(guarded_connection, "ASKED", 0.3)

    def visit(port):
        with line(port) as link:
            link.sendall(begun)
            began = time.monotonic()
            with contextlib.suppress(ConnectionResetError):
                assert link.recv(1) == b""
            return time.monotonic() - began

    assert over_a_slow_line(tmp_path, visit) < 9


def test_who_does_not_take_an_answer_is_ended(tmp_path, monkeypatch):
    monkeypatch.setattr(guarding, "ANSWERED", 0.5)

    def visit(port):
        with line(port) as link:
            link.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            time.sleep(3)
            found = 0
            with contextlib.suppress(ConnectionResetError):
                while block := link.recv(65_536):
                    found += len(block)
            return found

    assert over_a_slow_line(tmp_path, visit) < len(BODY)
