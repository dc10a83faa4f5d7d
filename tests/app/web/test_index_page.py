"""The head of the page as it leaves the server: no browser, no session."""

import gzip
import urllib.error
import urllib.request

import pytest
from websockets.datastructures import Headers
from websockets.http11 import Response

from app.web.index_page import IndexPage, head_html
from tests.app.stand_ins import served

PACKED = b'<script data-p="</head><body>">run()</script>'
INDEX = (
    b'<!doctype html><html><head><meta name="viewport" content="x"/><link\n rel="icon" href="x"/><title>Viser</title>'
    b"</head><body>\x00</body>"
)


def answer(body, kind="text/html; charset=utf-8", packing="identity", status=200):
    return Response(status, "OK", Headers({"Content-Type": kind, "Content-Encoding": packing}), body)


@pytest.mark.parametrize("packing", ["gzip", "identity"])
def test_title_and_icon_are_ours_and_the_rest_of_the_page_is_as_it_was(packing):
    packed = gzip.compress(INDEX) if packing == "gzip" else INDEX
    dressed = IndexPage().dressed(answer(packed, packing=packing))
    body = gzip.decompress(dressed.body) if packing == "gzip" else dressed.body
    assert body.count(b"<title>") == body.count(b'rel="icon"') == 1
    assert b"ET-Net viewer" in body
    assert body.count(b'name="viewport"') == 1
    assert b"minimum-scale=1" in body
    assert b"</head><body><script>" in body
    assert body.endswith(b"\x00</body>")
    assert dressed.headers["Content-Length"] == str(len(dressed.body))


def test_ours_runs_before_visers_client_and_what_is_shown_at_once_stands_before_it():
    page = IndexPage()
    before = page.dressed(answer(INDEX.replace(b"</head>", PACKED + b"</head>"))).body
    page.begin_with('<div class="etv-opening">')
    body = page.dressed(answer(INDEX.replace(b"</head>", PACKED + b"</head>"))).body
    for made in (before, body):
        assert made.count(PACKED) == 1
        assert made.index(b"window.etnetSay = ") < made.index(b"\x00") < made.index(PACKED)
        assert made.endswith(b"</body>")
    assert b'<div class="etv-opening">' not in before
    assert body.index(b'<div class="etv-opening">') < body.index(PACKED)


def test_what_is_no_page_goes_out_as_it_is():
    for plain in (answer(b"\x89PNG", "image/png"), answer(b"no", status=404), answer(b"?", packing="br")):
        assert IndexPage().dressed(plain) is plain


def test_only_a_public_address_has_a_picture_and_it_cannot_break_out_of_its_attribute():
    assert "og:image" not in head_html(None)
    assert 'content="https://events.example.org/static/social.jpg"' in head_html("https://events.example.org/")
    assert '"><script>' not in head_html('https://x/"><script>')


def test_what_the_head_names_is_served():
    with served() as viewer:
        for name in ("icon.svg", "social.jpg", "tour.js", "tidy.js"):
            with urllib.request.urlopen(f"http://127.0.0.1:{viewer.port}/static/{name}", timeout=10) as got:
                assert got.status == 200
                assert len(got.read()) > 100
