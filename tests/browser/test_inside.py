"""Pixel → atlas → head → mask → twin → reset, two pinned moments, and the keys of a map, in a real browser."""

from pathlib import Path

import pytest
from playwright.sync_api import Error as BrowserError

from tests.browser.chromium import box_of, open_page, until_window

SITE, OTHER = "scale1.encoder.0.self", "scale3.encoder.1.self"


@pytest.fixture
def page(browser, viewer):
    """A page of its own for each test: what is pinned, masked or opened stays in a page."""
    opened = open_page(browser, viewer.url)
    yield opened
    assert opened.errors == []
    opened.context.close()


def click(page, key):
    press_at(page, page.locator(f"[data-k='{key}']:visible").first)


def press_at(page, locator):
    """To the point: what is drawn again with every push is never stable."""
    locator.wait_for()
    for _ in range(50):
        locator.evaluate("element => element.scrollIntoViewIfNeeded()")
        box = box_of(page, locator)
        at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        is_there = "([x, y, one]) => one.contains(document.elementFromPoint(x, y))"
        if locator.evaluate(f"(one, at) => ({is_there})([...at, one])", list(at)):
            page.mouse.click(*at)
            page.num_clicks = getattr(page, "num_clicks", 0) + 1
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"something lies over {locator}")


def choose_pixel(page, u=0.5, v=0.5):
    """By a click at a share of the image. While a page settles its image moves, and a click at its edge may miss it."""
    until_window(page, 0)
    chosen = page.get_by_test_id("ablation").locator("h4")
    for _ in range(20):
        box = box_of(page, page.get_by_test_id("reconstruction").locator("img"))
        page.mouse.click(box["x"] + 1 + u * (box["width"] - 2), box["y"] + 1 + v * (box["height"] - 2))
        try:
            return chosen.wait_for(timeout=page.patience / 20)
        except BrowserError:
            continue
    raise AssertionError("no click on the image chooses a pixel")


def choose_network(page, name):
    """As the list of networks in Compare does."""
    page.evaluate("key => window.etnetSay('pick', key, 0, 0)", f"compare:model:0:{name}")


def to_attention(page, u=0.5, v=0.5):
    choose_pixel(page, u, v)
    click(page, "workspace:attention")
    page.get_by_test_id("peak").wait_for()
    page.num_clicks = 0


def test_from_a_pixel_to_a_head_a_mask_its_twin_and_back(page):
    to_attention(page)
    measured = page.locator(f"[data-etv-site='{OTHER}'] .et-effects[title^='head 0']")
    measured.wait_for(state="attached")
    assert page.num_clicks == 0  # whether a head matters

    press_at(page, page.get_by_test_id(OTHER).locator("img"))
    page.get_by_test_id("map-line").get_by_text(OTHER).wait_for()
    for head in range(4):
        page.get_by_test_id(f"head-{head}").wait_for()
    assert page.num_clicks <= 2  # all heads of a site

    page.num_clicks = 0
    click(page, "set:attention.curve:effect")
    reaches = "() => document.querySelector('.et-over-time .et-loud')?.getAttribute('points').split(' ').length > 20"
    page.wait_for_function(reaches)
    assert page.num_clicks <= 2  # what changes over the next 20 windows

    click(page, "set:attention.head:3")
    click(page, f"inspect:switch:head {OTHER} 3")
    page.get_by_test_id("change-in-bar").get_by_text("head 3 of 1/8 encoder 1, self masked").wait_for()
    page.locator(".et-mark").get_by_text("head 3 masked").wait_for()
    page.get_by_test_id("change-mark").first.wait_for(state="attached")

    click(page, "workspace:inspect")
    page.get_by_test_id("chip-warning").filter(has_text="changed").first.wait_for()
    page.keyboard.down("x")  # the original while it is held
    page.get_by_test_id("chip-exact").first.wait_for()
    page.keyboard.up("x")
    page.get_by_test_id("chip-warning").filter(has_text="changed").first.wait_for()
    click(page, "set:inspect.opened:twin")
    page.get_by_test_id("twin-pair").wait_for()
    click(page, "inspect:reset")
    page.get_by_test_id("change-in-bar").wait_for(state="detached")
    page.get_by_test_id("chip-exact").first.wait_for()


def test_two_moments_are_pinned_and_compared(page):
    to_attention(page)
    click(page, "attention:pin:a")
    page.get_by_test_id("a-minus-b").get_by_text("share 100 %").wait_for()
    page.locator("body").press("l")
    page.get_by_test_id("window").get_by_text("window 1 of").wait_for()
    page.get_by_test_id("pinned").get_by_text("window 0").wait_for()
    click(page, "attention:pin:b")
    page.get_by_test_id("pinned").get_by_text("window 1").wait_for()
    click(page, "attention:compare:none")
    page.get_by_test_id("peak").wait_for()


def test_a_pinned_moment_is_held_against_another_one_with_both_frames_and_outlives_the_network(page):
    to_attention(page)
    click(page, "attention:pin:a")
    page.get_by_test_id("a-minus-b").get_by_text("share 100 %").wait_for()
    for window in (1, 2, 3):
        page.locator("body").press("l")
        page.get_by_test_id("window").get_by_text(f"window {window} of").wait_for()
    below = page.locator(".et-frames-below figcaption")
    below.filter(has_text="now window 3").wait_for()
    below.filter(has_text="then window 0").wait_for()
    assert "share 100 %" not in page.get_by_test_id("a-minus-b").inner_text()
    first, second = (page.locator(".et-frames-below img").nth(i).get_attribute("src") for i in (0, 1))
    assert first != second
    choose_network(page, "pie-net-lite")  # it has no attention: the pin stays for when there is some again
    page.locator("[data-card='attention.map']").get_by_text("has no attention").wait_for()
    choose_network(page, "etnet-half")
    page.get_by_test_id("pinned").get_by_text("window 0").wait_for()
    below.filter(has_text="then window 0").wait_for()


def test_sites_are_stepped_through_while_the_atlas_shows_dots(page):
    to_attention(page)
    click(page, "set:attention.shows_dots:True")
    page.get_by_test_id("dot").first.wait_for()
    press_at(page, page.locator("[data-card='attention.map'] [data-etv-values]"))
    shown = page.get_by_test_id("map-line").locator("code")
    shown.get_by_text(SITE).wait_for()
    page.keyboard.press("]")
    page.wait_for_function(
        "site => !document.querySelector('[data-testid=map-line] code')?.textContent.startsWith(site)", arg=SITE
    )
    page.keyboard.press("[")
    shown.get_by_text(SITE).wait_for()


def test_every_site_of_the_atlas_lies_within_its_card_without_scrolling(browser, viewer):
    page = open_page(browser, viewer.url, 1600, 900)
    to_attention(page)
    page.locator("[data-etv-site]").nth(20).wait_for()
    for order in ("network", "entropy"):
        page.get_by_label("Order").select_option(order)
        page.locator(".et-atlas.et-sorted" if order == "entropy" else ".et-atlas:not(.et-sorted)").wait_for()
        outside = page.evaluate("""() => {
            const card = document.querySelector("[data-card='attention.atlas']").getBoundingClientRect();
            const boxes = [...document.querySelectorAll("[data-etv-site]")].map((each) => each.getBoundingClientRect());
            const inside = (box) => box.left >= card.left - 1 && box.right <= card.right + 1
                && box.top >= card.top - 1 && box.bottom <= card.bottom + 1 && box.width > 8 && box.height > 8;
            return [boxes.length, boxes.filter((box) => !inside(box)).length];
        }""")
        assert outside == [21, 0]
    assert page.errors == []
    page.context.close()


def test_keys_move_the_query_the_site_and_the_head_while_a_map_has_the_focus(page):
    to_attention(page, 0, 0)  # the outermost pixel can be clicked
    page.get_by_text("Query: pixel 0, 0").wait_for()
    before = page.get_by_test_id("token").inner_text()
    page.keyboard.press("2")  # no map has the focus: this is the workspace's key
    page.get_by_test_id("peak").wait_for()
    press_at(page, page.locator("[data-card='attention.map'] [data-etv-values]"))
    page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "before => ![before, undefined].includes(document.querySelector('[data-testid=token]')?.innerText)", arg=before
    )
    page.keyboard.press("2")
    page.get_by_test_id("head-2").and_(page.locator(".et-chosen")).wait_for()
    page.keyboard.press("]")
    page.wait_for_function("site => !document.querySelector(`[data-etv-site='${site}'].et-chosen`)", arg=SITE)


def test_the_number_under_the_pointer_is_told_and_the_row_is_saved_as_it_stands_there(page):
    to_attention(page)
    map_ = page.locator("[data-card='attention.map'] [data-etv-values]")
    box = box_of(page, map_)
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    readout = page.locator("[data-card='attention.map'] [data-etv-readout]")
    readout.get_by_text("token ").wait_for()
    token = page.get_by_test_id("token").inner_text().rpartition(" ")[2]
    click(page, "set:attention.over:row")
    text = page.get_by_test_id("row").text_content()
    assert text.startswith("token,row,column,x,y,weight,times_uniform")
    with page.expect_download() as saving:
        press_at(page, page.locator("[data-etv-save-text]"))
    assert Path(saving.value.path()).read_text() == text
    assert saving.value.suggested_filename == f"{SITE}_mean_token{token}_window0.csv"


def test_what_a_pixel_owes_to_each_part_stands_there_without_a_click_more(page):
    choose_pixel(page)
    page.get_by_test_id("moved").nth(4).wait_for()
    click(page, "set:inspect.opened:matters")
    page.get_by_test_id("verdict").get_by_text("At this pixel").wait_for()
    assert page.get_by_test_id("part").count() == 8


def test_a_change_that_is_carried_on_begins_at_its_window(page):
    until_window(page, 0)
    page.locator("body").press("l")
    until_window(page, 1)
    click(page, "set:inspect.opened:change")
    click(page, "inspect:scope:on")
    click(page, "inspect:edit:drop:0.9")
    page.get_by_test_id("outcome").wait_for()
    page.locator("body").press("j")
    page.get_by_text("It begins at window 1: here the image is original.").wait_for()
    page.get_by_test_id("chip-exact").first.wait_for()


def test_on_a_phone_a_finger_can_open_an_inspector(browser, viewer):
    phone = open_page(browser, viewer.url, 390, 844)
    phone.get_by_test_id("open-matters").tap()
    phone.get_by_test_id("verdict").get_by_text("decides most").wait_for()
    assert phone.errors == []
    phone.context.close()
