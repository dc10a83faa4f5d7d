"""Keys, the list of recordings, windows over the page, the timeline under the pointer: by hand, as a visitor's."""

import pytest
from playwright.sync_api import expect

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import at_rest, box_of, open_page, open_workspace
from tests.browser.conftest import ROI

CAMERA = "window.__viserMutable.cameraControl.getPosition(window.__viserMutable.cameraControl.getTarget()).toArray()"

KEPT = r"""() => Object.values(localStorage).some((text) => /index\W+1\b/.test(text))"""
"""Whether the browser has the view of window 1, which the page is given back by."""


def window(page, number):
    page.get_by_test_id("window").get_by_text(f"window {number} of").wait_for()


def test_arrows_step_and_never_move_the_camera_of_the_scene(page):
    placed = f"{CAMERA}.some((at) => Math.abs(at + 3) > 1e-6)"  # no longer where viser begins
    page.wait_for_function(f"() => window.__viserMutable?.cameraControl && {placed}")
    before = at_rest(page, CAMERA)
    for key, number in (("ArrowRight", 1), ("ArrowRight", 2), ("ArrowUp", 2), ("ArrowDown", 2), ("ArrowLeft", 1)):
        page.keyboard.press(key)
        window(page, number)
    assert page.evaluate(CAMERA) == pytest.approx(before, abs=1e-9)


def test_a_list_that_was_chosen_from_gives_the_keys_back(page):
    open_workspace(page, "compare")
    choice = page.get_by_label("Metric", exact=True)
    choice.select_option(label="SSIM")
    chosen = choice.input_value()
    page.keyboard.press("ArrowRight")
    window(page, 1)
    page.keyboard.type("sm")
    expect(page.get_by_label("Metric", exact=True)).to_have_value(chosen)
    assert page.evaluate("document.activeElement.matches('select, input')") is False


def test_the_list_of_recordings_is_searched_and_closes_by_escape_and_by_a_click_elsewhere(page):
    recordings = page.locator(".etv-recordings")
    rows = recordings.locator(".etv-list button:not([hidden])")
    recordings.locator("summary").click()
    rows.first.wait_for()
    expect(rows.nth(2)).to_be_visible()
    for index in range(3):  # sensor and duration, which are read beside the page
        expect(rows.nth(index)).to_contain_text("×")
        expect(rows.nth(index)).to_contain_text(" s")
    page.keyboard.type("roll")
    expect(rows).to_have_count(1)
    page.keyboard.press("ArrowRight")  # typed into the search, not stepped
    window(page, 0)
    page.keyboard.press("Escape")
    expect(recordings).not_to_have_attribute("open", "")
    recordings.locator("summary").click()
    rows.first.wait_for()
    page.locator("[data-card=voxels] h3").first.click()
    expect(recordings).not_to_have_attribute("open", "")


def test_what_is_typed_right_after_the_list_was_opened_goes_into_its_search(page):
    opens = "() => { document.querySelector('.etv-recordings summary').click(); return document.activeElement.type; }"
    assert page.evaluate(opens) == "search"
    page.keyboard.press("Escape")
    page.locator(".etv-recordings summary").focus()
    page.keyboard.press("Enter")
    page.keyboard.type("roll")
    expect(page.locator(".etv-recordings .etv-list button:not([hidden])")).to_have_count(1)
    shuts = """() => {
      document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }));
      return document.activeElement === document.body;
    }"""
    assert page.evaluate(shuts)  # the next key is the page's


def test_on_a_phone_the_list_lies_within_the_page_and_the_page_stays_where_it_is(page):
    page.set_viewport_size({"width": 390, "height": 844})
    where = at_rest(page, "document.querySelector('.etv-bar').getBoundingClientRect().x")
    page.locator(".etv-recordings summary").click()
    box = box_of(page, page.locator(".etv-recordings .etv-list"))
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= 390
    assert page.evaluate("document.querySelector('.etv-bar').getBoundingClientRect().x") == where
    page.keyboard.press("Escape")


def test_help_closes_by_escape_and_by_a_click_beside_it(page):
    page.keyboard.type("?")
    page.get_by_test_id("help").wait_for()
    page.keyboard.press("Escape")
    page.get_by_test_id("help").wait_for(state="detached")
    page.keyboard.type("?")
    page.get_by_test_id("help").wait_for()
    page.mouse.click(12, 360)
    page.get_by_test_id("help").wait_for(state="detached")


def test_the_pointer_on_the_timeline_tells_time_window_and_a_frame_that_is_kept(page):
    page.keyboard.press("ArrowRight")
    window(page, 1)
    page.locator("img[alt='Reconstruction of window 1']").first.wait_for()
    axis = page.locator(".et-axis").first
    box, duration = box_of(page, axis), float(axis.get_attribute("data-duration"))
    x = box["x"] + box["width"] * 0.078 / duration  # windows are 40 ms long
    page.mouse.move(x, box["y"] + 8)
    page.mouse.move(x + 1, box["y"] + 9)
    told = page.locator(".etv-hover")
    told.get_by_text("window 1").wait_for()
    told.locator("img:not([hidden])").wait_for()
    page.mouse.move(box["x"], 5)
    told.wait_for(state="hidden")


@pytest.mark.parametrize("size", [(1600, 900), (1280, 720), (390, 844)])
def test_every_fact_of_the_header_can_be_read_at_every_width(page, size):
    page.set_viewport_size({"width": size[0], "height": size[1]})
    listed, line = page.get_by_test_id("all-facts"), page.get_by_test_id("provenance")
    line.locator("[data-fact=state]").wait_for(state="attached")
    if size[0] > 1500:
        for fact in line.locator("[data-fact]").all():
            expect(fact).to_be_visible()
        expect(listed).to_be_hidden()
        return
    listed.get_by_role("button").hover()
    for name in ("Sensor", "Density", "Network", "Windowing", "Recurrent state"):
        expect(listed.get_by_text(name, exact=True)).to_be_visible()
    box = box_of(page, listed.locator("dl"))
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= size[0]
    lies_over = (
        "box => document.elementFromPoint(box.x + box.width - 9, box.y + box.height - 9).closest('.etv-all') !== null"
    )
    assert page.evaluate(lies_over, box)
    page.mouse.move(5, size[1] / 2)


def test_the_tour_ends_when_what_it_points_at_has_gone(browser, viewer):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = open_page(browser, viewer.url, context=context)
    tour = page.get_by_test_id("tour")
    tour.get_by_text("1 of").wait_for()
    page.keyboard.press("3")
    tour.wait_for(state="detached")
    assert page.evaluate("localStorage.getItem('etnet-tour')") == "seen"
    context.close()


def test_a_lost_server_is_told_in_a_sentence_and_the_page_returns_by_itself(browser):
    served = Viewer(ViewerConfig(port=0, budget=256, threads=1, roi=",".join(map(str, ROI))))
    page = open_page(browser, served.url)
    page.keyboard.press("ArrowRight")
    window(page, 1)
    page.wait_for_function(KEPT)
    served.stop()
    lost = page.get_by_role("alert").get_by_text("The viewer does not answer")
    lost.wait_for()
    again = Viewer(ViewerConfig(port=served.port, budget=256, threads=1, roi=",".join(map(str, ROI))))
    try:
        lost.wait_for(state="hidden")
        window(page, 1)
        page.keyboard.press("ArrowRight")
        window(page, 2)
        page.context.close()
    finally:
        again.stop()
