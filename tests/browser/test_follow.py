"""A talk: the audience's pages show the presenter's moment, each with a pointer of its own."""

import pytest

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import at_rest, box_of, open_page, open_workspace, until_window
from tests.browser.conftest import ROI
from tests.browser.test_page import BLOCKS


def on_window(page, index):
    page.get_by_test_id("window").get_by_text(f"window {index} of").wait_for()


@pytest.fixture(scope="module")
def talk(browser):
    running = Viewer(ViewerConfig(follow=True, port=0, budget=128, threads=1, roi=",".join(map(str, ROI))))
    yield running
    running.stop()


def test_a_page_that_follows_shows_the_presenters_moment_and_keeps_its_pixel_and_workspace(browser, talk):
    leader = open_page(browser, talk.url)
    follower = open_page(browser, talk.url)
    leader.get_by_test_id("presenting").get_by_text("Presenting to 1 page").wait_for()
    follower.get_by_test_id("presenting").get_by_text("Following the presenter").wait_for()
    until_window(follower, 0)
    at_rest(follower, BLOCKS)
    image = box_of(follower, follower.get_by_alt_text("Reconstruction of window 0", exact=True))
    follower.mouse.click(image["x"] + image["width"] / 4, image["y"] + image["height"] / 4)
    follower.get_by_test_id("query").first.wait_for()
    open_workspace(follower, "attention")
    for _ in range(3):
        leader.locator("body").press("l")
    for page in (leader, follower):
        on_window(page, 3)
    assert follower.locator("[data-etv-workspace=attention]").count() == 1
    assert leader.locator("[data-etv-workspace=inspect]").count() == 1
    assert leader.get_by_test_id("query").count() == 0
    follower.locator("body").press("End")  # the moment is the presenter's alone
    leader.locator("body").press("l")
    for page in (leader, follower):
        on_window(page, 4)
    leader.context.close()
    follower.get_by_test_id("presenting").get_by_text("Presenting").wait_for()  # its lead is kept for ten seconds
    assert follower.errors == []
    follower.context.close()
