"""Pages that visitors took home, over the real server: by their address alone, for a while, in no list."""

import http.client

import pytest
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.sync.client import connect

from app.catalogue.homes import PATH, Homes
from app.config import ViewerConfig
from app.main import Viewer
from app.web.server import Address, free_port, start_server


@pytest.fixture
def homes():
    return Homes(lives=1e9)


@pytest.fixture
def port(homes):
    server = start_server(
        Address(token="secret"), free_port("127.0.0.1", 18_450), lambda client: None, None, {}, homes.get
    )
    yield server.get_port()
    server.stop()


def ask(port, path):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.request("GET", path)
    answer = connection.getresponse()
    found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


def test_a_page_is_had_by_its_address_without_the_token_and_cut_off_from_the_viewer(port, homes):
    path = homes.put(b"<p>three seconds</p>")
    status, headers, body = ask(port, path)
    assert (status, body) == (200, b"<p>three seconds</p>")
    assert headers["Content-Security-Policy"].startswith("sandbox")
    assert headers["Cache-Control"] == "no-store"


def test_when_its_time_is_over_it_is_gone(port, homes):
    path = homes.put(b"page")
    assert ask(port, path)[0] == 200
    homes._held[path] = (0.0, b"page")
    assert ask(port, path)[0] != 200
    assert b"page" not in ask(port, path)[2]


@pytest.mark.parametrize("path", [PATH, PATH.rstrip("/"), f"{PATH}..", f"{PATH}*", f"{PATH}?list=1", f"{PATH}%2e"])
def test_nothing_lists_them(port, homes, path):
    homes.put(b"somebody's page")
    status, _, body = ask(port, path)
    assert status != 200
    assert b"somebody" not in body
    assert PATH.encode() not in body


def knock(address):
    with connect(address, open_timeout=10) as socket:
        socket.send('{"ticket": "x"}')
        socket.recv(timeout=10)


def test_what_the_host_switched_off_has_no_door_and_no_page():
    viewer = Viewer(
        ViewerConfig(demo=True, port=0, model="leaky-integrator", cache="off", take_home=False, camera=False)
    )
    try:
        assert (viewer.homes, viewer.mirrors) == (None, None)
        with pytest.raises((ConnectionClosed, InvalidHandshake, OSError)):
            knock(f"ws://127.0.0.1:{viewer.port}/camera")
        assert ask(viewer.port, f"{PATH}{'a' * 24}")[0] != 200
    finally:
        viewer.stop()
