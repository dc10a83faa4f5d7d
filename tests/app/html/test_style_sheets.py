"""What the style sheets promise: few sizes of type, text that can be read, nothing that is named and not there."""

import re

import pytest

from app.html.assets import page_folder

SHEETS = ("tokens.css", "panels.css", "page.css", "demo.css")
GROUNDS = ("ground", "card", "raised", "inset")


def sheet(name):
    return re.sub(r"/\*.*?\*/", "", (page_folder() / name).read_text("utf-8"), flags=re.DOTALL)


TOKENS = dict(re.findall(r"--([\w-]+):\s*([^;]+);", sheet("tokens.css")))


def luminance(colour):
    value = colour.lstrip("#")
    channels = [int(value[i : i + 2], 16) / 255 for i in (0, 2, 4)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(colour, ground):
    light, dark = sorted((luminance(TOKENS[colour]), luminance(TOKENS[ground])), reverse=True)
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("ground", GROUNDS)
@pytest.mark.parametrize(
    ("colour", "least"),
    [("text", 7), ("muted", 7), ("exact", 7), ("warning", 7), ("danger", 7), ("accent", 7), ("faint", 4.5)],
)
def test_text_has_a_contrast_of_seven_to_one_and_what_is_small_and_grey_of_four_and_a_half(colour, ground, least):
    assert contrast(colour, ground) >= least


def test_polarity_has_its_two_hues_and_the_accent_is_neither():
    from etnet.render.colours import OFF, ON, hexadecimal

    assert (TOKENS["on"], TOKENS["off"]) == (hexadecimal(ON), hexadecimal(OFF))
    assert TOKENS["accent"] not in (TOKENS["on"], TOKENS["off"])
    assert contrast("on", "inset") >= 7
    assert contrast("off", "inset") >= 7


def test_there_are_four_sizes_of_type():
    assert [TOKENS[name] for name in ("small", "body", "title", "large")] == ["12px", "13px", "14px", "20px"]


def sizes(text):
    return [int(size) for size in re.findall(r"font(?:-size)?:[^;}]*?\b(\d+)px", text)]


@pytest.mark.parametrize("name", SHEETS)
def test_no_type_is_too_small_to_read_but_an_arrow(name):
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", sheet(name))
    assert all(size >= 11 for _, body in rules if "content:" not in body for size in sizes(body))


def test_what_the_demo_says_is_set_in_eighteen_pixels_or_more_but_on_a_phone():
    booth, phone = sheet("demo.css").split("@media (max-width: 600px)", 1)
    said = re.findall(r"(\.etv-demo[^{}]*|\.etv-big[^{}]*|\.etv-caption[^{}]*)\{([^{}]*)\}", booth)
    assert all(size >= 15 for _, body in re.findall(r"(\.etv-big[^{}]*)\{([^{}]*)\}", phone) for size in sizes(body))
    assert said
    assert all(size >= 18 for _, body in said for size in sizes(body))


@pytest.mark.parametrize("name", SHEETS)
def test_every_brace_is_closed_and_every_token_is_defined(name):
    text = sheet(name)
    assert text.count("{") == text.count("}")
    known = set(re.findall(r"--([\w-]+)\s*:", "".join(sheet(each) for each in SHEETS)))
    set_by_pages = {
        "x",
        "n",
        "base",
        "columns",
        "ratio",
        "hue",
        "wipe",
        "from",
        "drag-x",
        "lines",
        "rows",
        "zoom",
        "place",
    }
    set_by_pages |= {"place", "swipe", "u", "v", "zoom-by", "zoom-x", "zoom-y"}
    undefined = set(re.findall(r"var\(--([\w-]+)", text)) - known - set_by_pages
    assert not {name for name in undefined if not name.startswith(("mantine-", "scene-"))}
