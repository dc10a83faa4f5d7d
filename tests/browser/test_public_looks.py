"""How the demo looks: nothing flashes, the large picture is large, the scene is there, help speaks of what one has."""

import json
import time

import cv2
import numpy as np
import pytest

from tests.browser.booth import OURS, REACHED, close, open_demo, press, touch
from tests.browser.capture import record
from tests.browser.chromium import PATIENCE, box_of
from tests.browser.faults import SCENE

WATCHED = f"""(() => {{
  window.flashed = new Set();
  const look = () => {{
    for (const html of ({REACHED})({json.dumps(OURS)})) window.flashed.add(html);
    requestAnimationFrame(look);
  }};
  requestAnimationFrame(look);
}})()"""


def test_when_the_page_starts_over_it_stays_dark_and_nothing_of_visers_own_flashes(browser, demo, stays):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    context.add_init_script(WATCHED)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(f"{demo.url}/?fixedDpr=1")
    page.locator(".etv-image img").wait_for()

    def come():
        page.reload(wait_until="commit")
        page.locator(".etv-image img").wait_for()
        page.wait_for_timeout(2000)

    film = record(page, come)
    assert len(film.frames) > 10
    corners = [frame[[2, 2, -3, -3], [2, -3, 2, -3]].max() for frame in film.frames]
    assert max(corners) < 90, "a white frame between two dark ones is a flash"
    assert page.evaluate("() => [...window.flashed]") == []
    context.close()


def until_painted(page):
    """The canvas lies where it should; what is drawn in it comes with one of the next frames."""
    ends = time.monotonic() + PATIENCE / 1000
    while colours_of(page) <= 20:
        assert time.monotonic() < ends
        page.wait_for_timeout(200)


@pytest.mark.parametrize("size", [(430, 932), (390, 844), (360, 640), (1280, 720)])
def test_the_scene_is_never_blank(browser, demo, stays, size):
    page = open_demo(browser, demo, *size)
    page.locator(".etv-demo[data-act=events]").wait_for()
    page.wait_for_function(SCENE)
    until_painted(page)
    for _ in range(3):
        assert colours_of(page) > 20, "image, dots and ground have more colours than one"
        page.wait_for_timeout(500)
    touch(page)
    page.get_by_test_id("map").wait_for()
    press(page, "Back to the events")
    page.locator("[data-large=cloud]").wait_for()
    page.wait_for_function(SCENE)
    until_painted(page)
    close(page)


def colours_of(page):
    """How many colours are painted where the scene stands."""
    box = box_of(page, page.locator(".etv-scene-slot"))
    shot = np.frombuffer(page.screenshot(clip=box), np.uint8)
    return len(np.unique(cv2.imdecode(shot, cv2.IMREAD_COLOR).reshape(-1, 3), axis=0))


def test_the_large_picture_of_each_act_is_large(browser, demo, stays):
    page = open_demo(browser, demo, 1600, 900)
    for act, large in (("events", ".etv-scene-slot"), ("image", ".etv-scene-slot"), ("places", ".etv-map .et-picture")):
        page.locator(f".etv-demo[data-act={act}]").wait_for()
        page.locator(large).wait_for()
        assert box_of(page, page.locator(large))["width"] >= 640
    for small in (".etv-image .et-picture", ".etv-camera .et-picture"):
        assert box_of(page, page.locator(small))["width"] >= 320
    close(page)


def test_on_a_phone_the_help_speaks_of_touch_and_the_tour_points_at_what_is_there(browser, demo, stays):
    page = open_demo(browser, demo, 390, 844)
    page.get_by_role("button", name="Help").tap()
    page.locator(".etv-with-touch").get_by_text("tap a picture").wait_for()
    assert not page.locator(".etv-with-keys").is_visible()
    assert not page.locator(".etv-with-mouse").is_visible()
    page.get_by_text("Show me around").tap()
    tour = page.get_by_test_id("tour")
    tour.get_by_text("1 of").wait_for()
    number = int(tour.locator("h3").inner_text().split()[2])
    assert number >= 2
    for step in range(1, number + 1):
        tour.get_by_text(f"{step} of {number}").wait_for()
        assert page.locator(".etv-tour-frame").is_visible()
        tour.locator("[data-go=next]").click()
    tour.wait_for(state="detached")
    close(page)
