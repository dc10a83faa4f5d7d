"""The demo in public: what one visitor leaves behind is gone for the next, on a screen and on a phone."""

import pytest

from app.config import ViewerConfig
from app.main import Viewer
from app.session import demo as attract
from tests.browser.chromium import PATIENCE, open_page
from tests.browser.conftest import ROI


@pytest.fixture(scope="module")
def demo(browser):
    config = ViewerConfig(port=0, demo=True, precision="fp32", budget=256, threads=1, roi=",".join(map(str, ROI)))
    viewer = Viewer(config)
    yield viewer
    viewer.stop()


@pytest.fixture
def stays(monkeypatch):
    """The page stays with its visitor until this is called; then nobody has touched it for long enough."""
    monkeypatch.setattr(attract, "IDLE", 1e9)
    return lambda: monkeypatch.setattr(attract, "IDLE", 1.0)


def test_what_a_visitor_left_open_is_closed_when_the_show_starts_over(browser, demo, stays):
    page = open_page(browser, demo.url, 1600, 900)
    page.get_by_test_id("invitation").wait_for()
    page.mouse.click(800, 120)
    page.get_by_test_id("yours").wait_for()
    page.keyboard.type("?")
    page.get_by_text("Show me around").click()
    page.get_by_test_id("tour").wait_for()
    page.keyboard.press("Control+k")
    page.get_by_placeholder("Search commands").wait_for()
    stays()
    page.get_by_test_id("invitation").wait_for()
    page.get_by_test_id("tour").wait_for(state="detached")
    page.get_by_placeholder("Search commands").wait_for(state="hidden")
    page.wait_for_timeout(1500)
    assert page.get_by_test_id("invitation").is_visible(), "to close something is no touch"
    assert page.errors == []
    page.context.close()


def test_visers_remark_on_slow_drawing_goes_by_itself(browser, viewer, demo):
    remark = "Software WebGL rendering detected"
    page = browser.new_page()
    page.goto(f"{viewer.url}/?fixedDpr=1")
    page.get_by_text(remark).wait_for(timeout=PATIENCE)
    page.get_by_text(remark).wait_for(state="detached", timeout=PATIENCE)
    page.goto(f"{demo.url}/?fixedDpr=1")
    page.get_by_test_id("invitation").wait_for(timeout=PATIENCE)
    page.get_by_text(remark).wait_for(state="detached", timeout=5000)
    assert page.get_by_test_id("invitation").is_visible()
    page.context.close()


def test_on_a_phone_the_demo_invites_hands_over_and_shows_around(browser, demo, stays):
    phone = open_page(browser, demo.url, 390, 844)
    phone.get_by_test_id("invitation").wait_for()
    phone.touchscreen.tap(200, 150)
    phone.get_by_test_id("yours").wait_for()
    # Before another recording is chosen: while that opens, there is no timeline to point at.
    phone.locator(".etv-help-button").tap()
    phone.get_by_text("Show me around").tap()
    steps_in_sight(phone)
    phone.get_by_role("button", name="rolling").tap()
    phone.locator(".etv-chosen").get_by_text("rolling").wait_for()
    stays()
    phone.get_by_test_id("invitation").wait_for()
    assert phone.errors == []
    phone.context.close()


def test_in_public_the_tour_passes_over_what_is_not_in_sight(browser, demo, stays):
    page = open_page(browser, demo.url, 1600, 900)
    page.get_by_test_id("invitation").wait_for()
    page.keyboard.type("?")
    page.get_by_text("Show me around").click()
    steps_in_sight(page)
    page.context.close()


def steps_in_sight(page):
    """Go through the tour; each of its steps, fewer than five, must point at something."""
    tour = page.get_by_test_id("tour")
    tour.get_by_text("1 of").wait_for()
    number = int(tour.locator("h3").inner_text().split()[2])
    assert 2 <= number < 5
    for step in range(1, number + 1):
        tour.get_by_text(f"{step} of {number}").wait_for()
        assert page.locator(".etv-tour-frame").is_visible()
        tour.locator("[data-go=next]").click()
    tour.wait_for(state="detached")
