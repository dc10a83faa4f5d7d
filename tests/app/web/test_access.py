"""Who is let in: the real server on a free port, asked as a browser, a program and a foreign page would ask."""

import asyncio
import http.client
import socket

import pytest
import viser
from websockets.asyncio.client import connect
from websockets.datastructures import Headers
from websockets.exceptions import InvalidStatus
from websockets.http11 import Request

from app.config import ConfigError, ViewerConfig
from app.html.assets import page_folder
from app.web.access import AccessControl
from app.web.guesses import MOST_WRONG, Guesses
from app.web.requests import public_origin
from app.web.server import Address, AddressError, free_port, start_server


@pytest.fixture(scope="module")
def port():
    server = start_server(
        Address(token="secret-token", public_url="https://show.example/"),
        free_port("127.0.0.1", 18_400),
        lambda c: None,
    )
    yield server.get_port()
    server.stop()


def ask(port: int, path: str, **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    with connection.getresponse() as answer:
        found = answer.status, dict(answer.getheaders()), answer.read()
    connection.close()
    return found


@pytest.fixture(scope="module")
def known(port):
    cookie = ask(port, "/?token=secret-token")[1]["Set-Cookie"].partition(";")[0]
    return {"Cookie": f"other=1; {cookie}"}


def test_without_the_token_nothing_is_served(port):
    for path in ("/", "/static/logo.svg", "/?token=wrong", "/?token=", "/?token=%FF%FE"):
        assert ask(port, path)[0] == 401


def test_the_token_in_the_address_becomes_a_cookie_and_leaves_the_address(port, known):
    status, headers, _ = ask(port, "/?token=secret-token&darkMode=1")
    assert status == 302
    assert headers["Location"] == "/?darkMode=1"
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Lax" in headers["Set-Cookie"]
    assert ask(port, "/", **known)[0] == 200


def test_the_redirect_never_leaves_this_host(port):
    for path in ("//evil.example/", "/\\evil.example/", "///evil.example"):
        location = ask(port, f"{path}?token=secret-token")[1]["Location"]
        assert location.startswith("/")
        assert not location.startswith(("//", "/\\"))


def test_a_foreign_host_name_is_refused_before_the_token_is_looked_at(port, known):
    for host in ("evil.example", f"evil.example:{port}", "", "127.0.0.1.evil.example"):
        assert ask(port, "/", Host=host, **known)[0] == 421
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", "[::1]", f"[::1]:{port}", "show.example"):
        assert ask(port, "/", Host=host, **known)[0] == 200


def test_no_path_leads_out_of_the_static_folder(port, known):
    for path in (
        "/static/../app/web/access.py",
        "/static/%2e%2e/%2e%2e/pyproject.toml",
        "/static/..%5c..%5cx",
        "/static/none",
        "/static/%00",
        "/static//etc/passwd",
    ):
        assert ask(port, path, **known)[0] == 404
    status, headers, body = ask(port, "/static/logo.svg", **known)
    assert status == 200
    assert headers["Content-Type"] == "image/svg+xml"
    assert b"<svg" in body


def test_health_needs_no_token_and_names_no_version(port):
    assert ask(port, "/healthz")[2] == b"ok\n"


@pytest.mark.parametrize(
    ("origin", "cookie", "status"),
    [
        ("http://evil.example", True, 403),
        ("null", True, 403),
        (None, False, 401),
        ("own", False, 401),
    ],
)
def test_a_websocket_is_refused_to_foreign_pages_and_strangers(port, known, origin, cookie, status):
    async def attempt() -> int:
        headers = known if cookie else {}
        own = f"http://127.0.0.1:{port}" if origin == "own" else origin
        try:
            async with connect(
                f"ws://127.0.0.1:{port}",
                subprotocols=[f"viser-v{viser.__version__}"],
                origin=own,
                additional_headers=headers,
            ):
                return 101
        except InvalidStatus as refusal:
            return refusal.response.status_code

    assert asyncio.run(attempt()) == status


@pytest.mark.parametrize("origin", ["own", None, "https://show.example"])
def test_its_own_page_and_a_program_with_the_token_come_in(port, known, origin):
    async def attempt() -> bool:
        own = f"http://127.0.0.1:{port}" if origin == "own" else origin
        protocol = f"viser-v{viser.__version__}"
        async with connect(f"ws://127.0.0.1:{port}", subprotocols=[protocol], origin=own, additional_headers=known):
            return True

    assert asyncio.run(attempt())


def test_a_busy_port_gives_the_next_free_one():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        busy = taken.getsockname()[1]
        assert busy < free_port("127.0.0.1", busy) <= busy + 50


def test_a_host_that_is_not_this_machine_is_one_named_error():
    with pytest.raises(AddressError, match="try --host"):
        free_port("192.0.2.1", 8080)


def test_the_share_tunnel_stays_shut(port):
    server = start_server(Address(), free_port("127.0.0.1", 18_500), lambda c: None)
    try:
        assert server.request_share_url() is None
    finally:
        server.stop()


def guarded(**more):
    return AccessControl(page_folder(), **more)


def request(path="/", **headers):
    found = Headers()
    for name, value in {"Host": "localhost:8080", **headers}.items():
        found.set_insecure(name, value)  # as the parser does: a browser may send bytes that are no ASCII
    return Request(path, found)


def test_two_viewers_on_one_host_have_cookies_of_their_own(port):
    cookie = ask(port, "/?token=secret-token")[1]["Set-Cookie"]
    assert cookie.startswith(f"etnet_view_{port}=")
    assert "secret-token" not in cookie


def test_a_cookie_of_another_start_opens_nothing():
    first, second = guarded(token="t"), guarded(token="t")
    cookie = first.refuse_or_answer(request("/?token=t"), 8080).headers["Set-Cookie"].partition(";")[0]
    assert first.refuse_or_answer(request(Cookie=cookie), 8080) is None
    assert second.refuse_or_answer(request(Cookie=cookie), 8080).status_code == 401


FOREIGN = (
    'prefs={"theme":"dark"}', "a=b c", "flag", "version=3", "=", "a=\udcc3\udca9", "\udcff", 'a="b', "expires=1; path",
    "etnet_view_8080=another's", "etnet_view=1", "x" * 4000,
)  # fmt: skip


@pytest.mark.parametrize("foreign", FOREIGN)
@pytest.mark.parametrize("order", ["{ours}; {foreign}", "{foreign}; {ours}", "{foreign};{ours}", "{foreign} ; {ours} "])
def test_cookies_of_others_on_the_same_host_shut_nobody_out(foreign, order):
    guard = guarded(token="t")
    ours = guard.refuse_or_answer(request("/?token=t"), 8080).headers["Set-Cookie"].partition(";")[0]
    assert guard.refuse_or_answer(request(Cookie=order.format(ours=ours, foreign=foreign)), 8080) is None
    assert guard.refuse_or_answer(request(Cookie=foreign), 8080).status_code == 401


@pytest.mark.parametrize("value", ['"\udcff"', "\udcff", '"\\377"', '"', ""])
def test_a_cookie_that_is_no_text_is_a_wrong_one(value):
    assert guarded(token="t").refuse_or_answer(request(Cookie=f"etnet_view_8080={value}"), 8080).status_code == 401


def test_behind_https_the_cookie_is_secure_and_a_page_of_another_scheme_is_foreign():
    guard = guarded(token="t", public=public_origin("https://show.example/"))
    answer = guard.refuse_or_answer(request("/?token=t", Host="show.example"), 8080)
    assert "Secure" in answer.headers["Set-Cookie"]
    assert "Secure" not in guard.refuse_or_answer(request("/?token=t"), 8080).headers["Set-Cookie"]
    socket_ = {"Upgrade": "websocket", "Host": "show.example"}
    assert guard.refuse_or_answer(request(**socket_, Origin="https://show.example"), 8080).status_code == 401
    for origin in ("http://show.example", "https://show.example:444", "https://show.example.evil", "https://"):
        assert guard.refuse_or_answer(request(**socket_, Origin=origin), 8080).status_code == 403
    assert (
        guard.refuse_or_answer(request(Upgrade="websocket", Origin="https://localhost:8080"), 8080).status_code == 403
    )


def test_wrong_tokens_are_slowed_and_hold_up_nobody_else():
    now = [0.0]
    guard = guarded(token="right", guesses=Guesses(lambda: now[0]))
    cookie = guard.refuse_or_answer(request("/?token=right"), 8080, "a").headers["Set-Cookie"].partition(";")[0]
    codes = [guard.refuse_or_answer(request(f"/?token={i}"), 8080, "a").status_code for i in range(30)]
    assert codes == [401] * MOST_WRONG + [429] * (30 - MOST_WRONG)
    assert guard.refuse_or_answer(request("/?token=right"), 8080, "a").status_code == 429
    assert guard.refuse_or_answer(request("/?token=right"), 8080, "b").status_code == 302
    assert guard.refuse_or_answer(request(Cookie=cookie), 8080, "a") is None
    now[0] = 61.0
    assert guard.refuse_or_answer(request("/?token=right"), 8080, "a").status_code == 302


def test_where_it_listens_on_all_addresses_a_number_is_taken_and_a_name_is_not():
    guard = guarded(takes_numbers=True)
    assert guard.refuse_or_answer(request(Host="192.0.2.7:8080"), 8080) is None
    assert guard.refuse_or_answer(request(Host="[2001:db8::1]:8080"), 8080) is None
    assert guard.refuse_or_answer(request(Host="evil.example:8080"), 8080).status_code == 421
    assert guarded().refuse_or_answer(request(Host="192.0.2.7:8080"), 8080).status_code == 421


@pytest.mark.parametrize("address", ["show.example", "ftp://show.example", "http://[", "https://a b", ""])
def test_a_public_url_that_is_none_is_refused(address):
    assert public_origin(address) is None


@pytest.mark.parametrize("below", ["viewer", "viewer/", "/", "?a=b", "#a"])
def test_a_public_url_with_a_path_is_refused_for_the_viewer_answers_at_the_root_alone(below):
    assert public_origin(f"https://show.example/{below}") is None
    with pytest.raises(AddressError, match=r"https://show\.example, without a path"):
        start_server(Address(public_url=f"https://show.example/{below}"), 0, lambda c: None)
    with pytest.raises(ConfigError, match=r"https://show\.example, without a path"):
        ViewerConfig(public_url=f"https://show.example/{below}")


def test_a_public_url_may_end_with_its_slash():
    assert ViewerConfig(public_url="https://show.example/").is_open


def test_an_empty_token_lets_nobody_in():
    with pytest.raises(AddressError, match="empty token"):
        start_server(Address(token=""), 0, lambda c: None)
