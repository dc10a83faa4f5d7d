"""What all pictures are made with: the shared store, elements, words for numbers."""

import pytest

from app.engine.byte_cache import ByteCache
from app.html import units as words
from app.html.attention.maps import Site, site_words
from app.html.elements import empty, picture
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration


def test_the_store_never_grows_past_its_budget():
    store = ByteCache(10_000)
    for i in range(100):
        assert store.text(i, lambda i=i: str(i) * 500).startswith(str(i))
    assert store.nbytes <= 10_000
    assert 0 < len(store) < 100
    assert store.text("large", lambda: "x" * 20_000) == "x" * 20_000
    assert store.nbytes <= 10_000


def test_the_store_weighs_a_text_by_the_memory_it_takes():
    plain, with_a_dash = ByteCache(100_000), ByteCache(100_000)
    plain.text(0, lambda: "x" * 10_000)
    with_a_dash.text(0, lambda: "x" * 9_999 + "–")
    assert 10_000 <= plain.nbytes < 10_600
    assert 20_000 <= with_a_dash.nbytes < 20_600


def test_a_picture_can_be_clicked_exactly_when_a_click_on_it_says_something():
    assert 'data-k="k" data-pick="1"' in picture("u", "a", key="k")
    assert "data-k" not in picture("u", "a")
    assert "data-pick" not in picture("u", "a")
    assert "&lt;b&gt;" in empty("<b>", "x")
    assert "onerror=" not in picture("u", '" onerror="x', key='" onerror="x').replace("&quot; onerror=", "")


def test_sites_are_read_from_their_names():
    assert Site.of("scale2.decoder.0.cross") == (2, "decoder", 0, "cross")
    assert site_words("scale3.decoder.1.cross", ("scale1.encoder.0.self", "scale3.encoder.0.self")) == (
        "1/8 · decoder 2, cross-attention: 1/8 attends to 1/8"
    )


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (words.policy(BetweenFrames()), "between camera frames"),
        (words.policy(ByCount(10_000)), "every 10,000 events"),
        (words.policy(ByDensity(0.35)), "every 0.35 events per pixel"),
        (words.policy(ByDuration(20_000)), "every 20 ms"),
        (words.policy(ByDuration(20_000, 5_000)), "every 20 ms, one each 5.0 ms"),
        (words.seconds(0.62), "0.620 s"),
        (words.seconds(62.5, 1), "1 min 02.5 s"),
        (words.milliseconds(2310), "2.31 s"),
        (words.rate(640_000), "640 kev/s"),
        (words.short(0.0352), "0.0352"),
        (words.short(12_300), "12,300"),
        (words.fraction(0.25), "1/4"),
    ],
)
def test_numbers_are_said_in_plain_words(made, said):
    assert made == said
