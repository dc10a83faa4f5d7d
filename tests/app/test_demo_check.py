"""`--demo --check`: what it tries, what it says of what will fail, and its exit code."""

import shutil
import time
from collections import namedtuple
from types import SimpleNamespace

import pytest

from app import demo_check
from app.config import ViewerConfig
from app.demo_check import check_demo
from app.main import Viewer, main
from app.web.server import Address, free_port, start_server

QUICK = {"model": "leaky-integrator", "port": 0, "roi": "86,60,60,44", "cache": "off", "budget": 64, "threads": 1}
COMMAND = ["--demo", "--check"] + [word for name, value in QUICK.items() for word in (f"--{name}", str(value))]


@pytest.fixture(scope="module")
def tried():
    """A demo that takes files; what is found of it under other settings is by those."""
    viewer = Viewer(ViewerConfig(demo=True, uploads=4, **QUICK))
    yield viewer
    viewer.stop()


@pytest.fixture
def found(tried, monkeypatch):
    def find(**settings):
        monkeypatch.setattr(demo_check, "MIRROR_SECONDS", 0.5)
        monkeypatch.setattr(demo_check, "FEWEST_MIRRORED", settings.pop("fewest", 0.5))
        config = ViewerConfig(demo=True, uploads=4, **QUICK, **settings)
        return {finding.name: finding for finding in check_demo(tried, config)}

    return find


def test_a_demo_that_will_do_ends_with_0_and_leaves_nothing(capsys, monkeypatch):
    monkeypatch.setattr(demo_check, "FEWEST_MIRRORED", 0.5)  # this test may run beside others
    assert main(COMMAND) == 0
    said = capsys.readouterr().out
    assert "The demo is ready." in said
    assert "FAIL" not in said
    for name in ("page", "recording astronaut", "guard", "camera", "mirror", "uploads", "take home", "disk"):
        assert f"ok    {name}: " in said


def test_a_network_that_is_too_slow_is_said_and_the_exit_code_is_1(capsys, monkeypatch):
    monkeypatch.setattr(demo_check, "SLOWEST_STEP", 0.0)
    monkeypatch.setattr(demo_check, "MIRROR_SECONDS", 0.2)
    assert main([*COMMAND, "--no-camera", "--no-take-home"]) == 1
    said = capsys.readouterr().out
    assert "FAIL  recording astronaut: astronaut: an image takes" in said
    assert "will fail: see above" in said
    assert "mirror" not in said
    assert "take home" not in said


def test_what_is_tried_is_really_tried(found, tried):
    result = found()
    assert [finding.name for finding in result.values() if not finding.is_good] == []
    assert "images a second" in result["mirror"].words
    assert "events came in and was opened" in result["uploads"].words
    assert "was made in" in result["take home"].words
    assert tried.homes.nbytes > 10_000
    assert tried.uploads._desks == {}
    assert tried.mirrors._by_ticket == {}


def test_a_mirror_that_crawls_is_told_by_its_images_not_by_the_pictures_that_came_in(found, tried, monkeypatch):
    step = tried.engine._exact_step

    def slow(turn, loaded):
        time.sleep(0.6)
        return step(turn, loaded)

    monkeypatch.setattr(tried.engine, "_exact_step", slow)
    mirror = found(fewest=2.0)["mirror"]
    assert not mirror.is_good
    assert "images a second" in mirror.words
    assert "--no-camera" in mirror.words


def test_without_tls_the_camera_and_an_address_that_leads_nowhere_are_told(found):
    result = found(public_url="http://127.0.0.1:9")
    assert not result["camera"].is_good
    assert "TLS" in result["camera"].words
    assert not result["public address"].is_good
    assert "phones that read the code find nothing" in result["public address"].words


def test_an_address_that_leads_here_is_good(found, tried):
    assert found(public_url=f"http://127.0.0.1:{tried.port}")["public address"].is_good


def test_a_full_disk_is_told(found, monkeypatch):
    usage = namedtuple("Usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(1, 1, 1000))
    disk = found()["disk"]
    assert not disk.is_good
    assert "1 GB at least" in disk.words


def test_a_page_that_cannot_be_made_is_told(found, tried, monkeypatch):
    monkeypatch.setattr(demo_check, "MADE_WITHIN", 0.05)
    monkeypatch.setattr(tried.engine, "job", lambda *asked: None)
    home = found()["take home"]
    assert not home.is_good
    assert "not made within" in home.words


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "0.0.0.0", "localhost"])
@pytest.mark.parametrize("token", [None, "a b/ö&c=d"])
def test_the_page_is_found_wherever_the_viewer_listens_and_whatever_its_token(host, token):
    server = start_server(Address(host, token=token), free_port(host, 18_700), lambda client: None)
    viewer = SimpleNamespace(token=token, host=host, port=server.get_port(), url="its address")
    try:
        page, guard = demo_check._pages(viewer), demo_check._foreign(viewer)
    finally:
        server.stop()
    assert page.is_good, page.words
    assert guard.is_good, guard.words


@pytest.mark.parametrize(("host", "reached"), [("::", "[::1]"), ("fe80::1", "[fe80::1]"), ("0.0.0.0", "127.0.0.1")])
def test_an_address_with_colons_stands_in_brackets(host, reached):
    viewer = SimpleNamespace(token=None, host=host, port=8080)
    assert demo_check._local(viewer, "") == f"http://{reached}:8080/"
