"""What all pictures are made with: the shared store, elements, words for numbers."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.html import units as words
from app.html.attention.difference import difference_legend
from app.html.attention.links import link_words
from app.html.attention.maps import Site, site_words
from app.html.controls import percent
from app.html.elements import empty, picture
from etnet.inspection.links import Link
from etnet.windows import BetweenFrames, ByCount, ByDensity, ByDuration

EXPONENT = re.compile(r"\de[+-]\d")


def test_a_picture_can_be_clicked_exactly_when_a_click_on_it_says_something():
    assert 'data-k="k" data-pick="1"' in picture("u", "a", key="k")
    assert "data-k" not in picture("u", "a")
    assert "data-pick" not in picture("u", "a")
    assert "&lt;b&gt;" in empty("<b>", "x")
    assert "onerror=" not in picture("u", '" onerror="x', key='" onerror="x').replace("&quot; onerror=", "")


def test_sites_are_read_from_their_names():
    assert Site.of("scale2.decoder.0.cross") == (2, "decoder", 0, "cross")
    assert site_words("scale3.decoder.1.cross", ("scale1.encoder.0.self", "scale3.encoder.0.self")) == (
        "1/8 decoder 1, cross: 1/8 attends to 1/8"
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
        (words.short(0.00023), "0.00023"),
        (words.short(999.7), "1000"),
        (words.significant(160.0, 2), "160"),
        (words.significant(1234.5), "1234"),
        (words.significant(-0.000015), "-0.000015"),
        (words.rate(999_900), "1000 kev/s"),
        (words.fraction(0.25), "1/4"),
    ],
)
def test_numbers_are_said_in_plain_words(made, said):
    assert made == said


@given(st.floats(1e-12, 1e12), st.sampled_from([-1, 1]), st.integers(1, 6))
def test_no_number_has_an_exponent_and_each_is_right_to_its_digits(size, sign, digits):
    value = sign * size
    for text in (words.short(value), words.significant(value, digits), words.rate(size), percent(size)):
        assert not EXPONENT.search(text), text
    assert float(words.significant(value, digits)) == pytest.approx(value, rel=0.51 * 10 ** (1 - digits))
    link = Link(scale=1, token=0, pixel=(0, 0), weight=0.5, times_uniform=size)
    assert not EXPONENT.search(link_words((link,), 1))
    assert not EXPONENT.search(difference_legend(math.log2(size)))
