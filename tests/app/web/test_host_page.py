"""Whose page is the host's own: opened on this machine, by its own name, through no proxy."""

from contextvars import copy_context
from types import SimpleNamespace

import pytest
from websockets.datastructures import Headers

from app.web.peer import note_peer, sits_here


def _sits_here(address="127.0.0.1", host="localhost:8080", public_url=None, **headers):
    named = {name.replace("_", "-"): value for name, value in headers.items()}
    request = SimpleNamespace(headers=Headers({"Host": host, **named}))
    connection = SimpleNamespace(request=request, remote_address=(address, 50_000))

    def connects():
        note_peer(connection)
        return sits_here(public_url)

    return copy_context().run(connects)


def test_a_page_of_this_machine_is_the_hosts_own():
    assert _sits_here(Origin="http://localhost:8080")
    assert _sits_here("::1", "[::1]:8080", Origin="http://[::1]:8080")
    assert _sits_here("::ffff:127.0.0.1", "127.0.0.1:8080")


@pytest.mark.parametrize(
    "how",
    [
        {"address": "192.168.1.7", "host": "192.168.1.2:8080"},
        {"address": "192.168.1.7"},
        {"host": "show.example"},
        {"Origin": "https://show.example"},
        {"public_url": "https://show.example"},
        {"X_Forwarded_For": "10.1.2.3"},
        {"Via": "1.1 proxy"},
    ],
)
def test_any_other_page_is_not(how):
    assert not _sits_here(**how)


def test_nobody_is_the_host_before_a_connection_is_known():
    assert not sits_here(None)
