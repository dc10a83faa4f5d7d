"""Pixel → atlas → head → mask → twin → reset, two pinned moments, and the keys of a map, in a real browser."""

import pytest

from tests.browser.chromium import open_page, until_window

SITE, OTHER = "scale1.encoder.0.self", "scale3.encoder.1.self"


@pytest.fixture
def page(browser, viewer):
    """A page of its own for each test: what is pinned, masked or opened stays in a page."""
    opened = open_page(browser, viewer.url)
    yield opened
    assert opened.errors == []
    opened.context.close()


def click(page, key):
    page.locator(f"[data-k='{key}']:visible").first.click()


def choose_pixel(page):
    until_window(page, 0)
    page.get_by_test_id("reconstruction").locator("img").first.click()


def to_attention(page):
    choose_pixel(page)
    click(page, "workspace:attention")
    page.get_by_test_id("peak").wait_for()


def test_from_a_pixel_to_a_head_a_mask_its_twin_and_back(page):
    to_attention(page)
    page.get_by_test_id(OTHER).locator("img").click()
    page.get_by_test_id("map-line").get_by_text(OTHER).wait_for()
    click(page, "set:attention.head:3")
    click(page, f"inspect:switch:head {OTHER} 3")
    page.get_by_test_id("change-in-bar").get_by_text("head 3 of 1/8 encoder 2, self masked").wait_for()
    page.locator(".et-mark").get_by_text("head 3 masked").wait_for()
    page.get_by_test_id("change-mark").first.wait_for(state="attached")

    click(page, "workspace:inspect")
    page.get_by_test_id("chip-warning").filter(has_text="changed").first.wait_for()
    click(page, "set:inspect.opened:twin")
    page.get_by_test_id("twin-pair").wait_for()
    click(page, "inspect:reset")
    page.get_by_test_id("chip-exact").first.wait_for()
    assert page.get_by_test_id("change-in-bar").count() == 0


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


def test_keys_move_the_query_the_site_and_the_head_while_a_map_has_the_focus(page):
    to_attention(page)
    before = page.get_by_test_id("token").inner_text()
    page.keyboard.press("2")  # no map has the focus: this is the workspace's key
    page.get_by_test_id("peak").wait_for()
    page.locator("[data-card='attention.map'] [data-etv-values]").click()
    page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "before => ![before, undefined].includes(document.querySelector('[data-testid=token]')?.innerText)", arg=before
    )
    page.keyboard.press("2")
    page.get_by_test_id("head-2").and_(page.locator(".et-chosen")).wait_for()
    page.keyboard.press("]")
    page.wait_for_function("site => !document.querySelector(`[data-etv-site='${site}'].et-chosen`)", arg=SITE)


def test_the_number_under_the_pointer_is_told_without_the_server(page):
    to_attention(page)
    page.locator("[data-card='attention.map'] [data-etv-values]").hover()
    page.locator("[data-card='attention.map'] [data-etv-readout]").get_by_text("× uniform").wait_for()
    assert page.locator("[data-card='attention.map'] [data-etv-readout]").inner_text().startswith("token ")


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
