"""A booth that cannot be broken: nothing of viser's own is in reach, and what one visitor left is gone for the next."""

import json
import time
import urllib.request

import pytest

from tests.browser.booth import OURS, REACHED, close, open_demo, press, serve, touch
from tests.browser.chromium import PATIENCE, at_rest
from tests.browser.faults import FAULTS
from tests.simulation.films import drifting, write_film

SMALL = """() => [...document.querySelectorAll('.etv-demo button, .etv-demo-bar button, .etv-track')]
  .filter((element) => element.checkVisibility())
  .map((element) => [element.getBoundingClientRect(), element.outerHTML.slice(0, 120)])
  .filter(([box]) => box.width < 44 || box.height < 44 || box.left < 0 || box.right > innerWidth
    || box.bottom > innerHeight + 1)
  .map(([box, html]) => `${Math.round(box.width)}x${Math.round(box.height)} ${html}`)"""


@pytest.mark.parametrize("size", [(1600, 900), (1280, 720), (430, 932), (390, 844), (360, 640)])
def test_nothing_of_visers_own_is_in_reach(browser, demo, stays, size):
    page = open_demo(browser, demo, *size)
    for wanted in (f"({REACHED})({json.dumps(OURS)})", f"({SMALL})()", f"({FAULTS})()"):
        page.wait_for_function(f"() => {wanted}.length === 0")  # viser's docks come to rest
    touch(page)
    page.get_by_test_id("map").wait_for()
    assert page.evaluate(REACHED, OURS) == []
    page.wait_for_function(f"() => ({FAULTS})().length === 0")  # the scene leaves once the map has come
    page.keyboard.press("Control+k")
    page.wait_for_timeout(400)
    assert (
        page.get_by_placeholder("Search commands").count() == 0
        or not page.get_by_placeholder("Search commands").is_visible()
    )
    close(page)


def test_no_key_leads_out_of_the_demo(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    for key in "12345fiou":
        page.keyboard.press(key)
    page.get_by_test_id("yours").wait_for()  # a key is a touch
    page.keyboard.press("End")  # what was sent before it has been heard, too
    track = "document.querySelector('.etv-track')"
    page.wait_for_function(f"() => {track}.ariaValueNow > 0.9 * {track}.ariaValueMax")
    assert page.locator("[data-etv-workspace=demo]").count() == 1
    assert page.locator("[data-etv-public=none]").count() == 1
    assert page.locator("[data-large=cloud]").count() == 1
    assert page.evaluate(REACHED, OURS) == []
    close(page)


def test_a_visitor_who_comes_cold_sees_motion_at_once(browser, demo, stays):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.goto(f"{demo.url}/?fixedDpr=1")
    assert page.get_by_text("Server URL").count() == 0
    page.locator(".etv-camera img").wait_for()
    shown = "() => document.querySelector('.etv-image img')?.alt"
    page.wait_for_function(shown)
    page.wait_for_function(f"(first) => ({shown})() !== first", arg=page.evaluate(shown))
    context.close()


def test_events_move_before_visers_client_has_started(browser, demo, stays):
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    context.add_init_script("Object.defineProperty(document, 'readyState', { get: () => 'loading' })")
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    # viser's client begins when the page has been read; here it never learns of it.
    context.add_init_script("addEventListener('DOMContentLoaded', (e) => e.stopImmediatePropagation(), true)")
    page.goto(f"{demo.url}/?fixedDpr=1", wait_until="commit")
    strip = page.get_by_test_id("first").get_by_alt_text("Events")
    strip.wait_for()
    assert page.evaluate("() => window.__viserMutable") is None
    assert "Each dot" in page.get_by_test_id("first").inner_text()
    seen = {strip.evaluate("(image) => getComputedStyle(image).transform")}
    page.wait_for_function(
        "(seen) => getComputedStyle(document.querySelector('.etv-opening img')).transform !== seen", arg=seen.pop()
    )
    box, frame = strip.bounding_box(), page.locator(".etv-opening span").bounding_box()
    assert box["height"] == pytest.approx(16 * frame["height"], rel=0.01)
    assert page.get_by_test_id("first").evaluate("(first) => first.scrollWidth <= innerWidth")
    context.close()


def slowly(page):
    """Whatever script the page asks for comes late."""

    def late(route):
        page.wait_for_timeout(4000)
        route.continue_()

    page.route("**/static/*.js", late)


@pytest.mark.parametrize("act", ["finger", "key"])
def test_a_touch_on_the_first_picture_is_answered_whatever_script_comes_late(browser, demo, stays, act):
    page = open_demo(browser, demo, 1280, 720, slowly)
    touch(page) if act == "finger" else page.keyboard.press("ArrowRight")
    page.get_by_test_id("yours").wait_for()  # the show itself never says so
    page.locator(".etv-image .et-cross").first.wait_for()
    close(page)


def test_a_touch_before_the_page_has_started_takes_the_show_over(browser, demo, stays):
    ends = time.monotonic() + PATIENCE / 1000
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.errors = []
    page.goto(f"{demo.url}/?fixedDpr=1", wait_until="commit")
    loaded = None
    while page.get_by_test_id("yours").count() == 0:
        page.wait_for_function("() => window.etnetSay")
        if loaded != (loaded := page.evaluate("() => performance.timeOrigin")):
            page.mouse.click(300, 300)  # once a load: a page whose socket is late loads itself anew
        page.wait_for_timeout(200)
        assert time.monotonic() < ends, "the touch was not answered"
    close(page)


def test_a_visitor_sees_their_own_camera_as_a_sensor_does(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    press(page, "Your own face")
    page.get_by_text("Nothing is stored").wait_for()
    press(page, "Use my camera")
    page.get_by_test_id("mirror").wait_for()
    page.get_by_test_id("delay").wait_for()
    assert "simulated event sensor" in page.get_by_test_id("yours").inner_text()
    (mirror,) = demo.mirrors._running
    before = mirror._pixels._wanted[0]
    page.locator("[data-etv-mirror=contrast]").fill("0.9")
    until(lambda: mirror._pixels._wanted[0] < before / 1.5)  # a smaller change makes an event
    assert page.evaluate(REACHED, OURS) == []
    shown = "() => document.querySelector('.etv-image img')?.alt"
    first = page.evaluate(shown)
    page.wait_for_function(f"(first) => ({shown})() !== first", arg=first)
    touch(page)
    page.get_by_test_id("map").locator(".etv-traveller").wait_for(state="attached")  # where it looks, in the mirror too
    first = page.evaluate(shown)
    page.wait_for_function(f"(first) => ({shown})() !== first", arg=first)  # and the world goes on meanwhile
    press(page, "Stop the camera")
    page.get_by_test_id("mirror").wait_for(state="hidden")
    page.locator(".etv-image img").wait_for()
    assert page.locator("video").count() == 0
    close(page)


def until(condition, patience=60.0):
    ends = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < ends
        time.sleep(0.05)


def opens_as_a_page(page, address):
    """What was taken home is a page that opens."""
    taken = page.context.new_page()
    taken.set_default_timeout(PATIENCE)
    troubles = []
    taken.on("pageerror", lambda error: troubles.append(str(error)))
    taken.goto(address)
    taken.locator("html[data-shown]").wait_for()
    assert troubles == []
    return taken


def test_three_seconds_of_the_mirror_are_taken_home_though_the_camera_ends(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    press(page, "Your own face")
    page.get_by_text("Only what you take home is kept").wait_for()
    press(page, "Use my camera")
    page.get_by_test_id("delay").wait_for()
    page.wait_for_timeout(3000)
    slider = page.locator("[data-etv-mirror=contrast]")
    slider.fill("0.9")
    press(page, "Take it home")
    page.get_by_test_id("sheet-home").wait_for()
    assert slider.input_value() == "0.9"
    page.evaluate("() => document.querySelector('[data-etv-camera-stop]').click()")  # it ends by itself, too
    page.get_by_test_id("mirror").wait_for(state="hidden")
    link = page.get_by_test_id("home-link")
    link.wait_for(timeout=2 * PATIENCE)
    taken = opens_as_a_page(page, f"{demo.url}{link.get_attribute('href')}")
    assert "your own face" in taken.title()
    until(lambda: demo.catalogue._private == {})  # the mirror is forgotten once its page is there
    close(page)


def test_without_a_camera_a_video_is_picked_and_how_far_it_is_is_said(browser, stays, tmp_path):
    film = write_film(tmp_path / "own.mp4", drifting(90, 2.0, (320, 240)))
    viewer = serve(uploads=4, roi=None)  # of a video that is seen whole what is simulated by now is shown
    try:
        page = open_demo(browser, viewer, 390, 844)
        press(page, "Your own face")
        with page.expect_file_chooser() as chooser:
            press(page, "Your own video")
        chooser.value.set_files(film)
        page.get_by_text("The video becomes dots").first.wait_for()
        page.locator(".etv-image img").wait_for()
        page.get_by_test_id("film").wait_for(state="detached")
        shown = "() => document.querySelector('.etv-image img')?.alt"
        page.wait_for_function(f"(first) => ({shown})() !== first", arg=page.evaluate(shown))
        close(page)
    finally:
        viewer.stop()


def test_three_seconds_are_taken_home_as_a_page(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    press(page, "Take it home")
    link = page.get_by_test_id("home-link")
    link.wait_for(timeout=2 * PATIENCE)
    address = f"{demo.url}{link.get_attribute('href')}"
    with urllib.request.urlopen(address, timeout=10) as answer:
        assert answer.headers["Content-Security-Policy"].startswith("sandbox")
        assert b"page-facts" in answer.read()
    opens_as_a_page(page, address)
    close(page)


def test_arrow_keys_move_the_spot_that_the_network_is_asked_about(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    ring = page.locator(".etv-image .et-cross")
    page.keyboard.press("ArrowRight")
    page.get_by_test_id("yours").wait_for()
    ring.first.wait_for()
    at = ring.get_attribute("style")
    page.keyboard.press("ArrowLeft")
    where = "document.querySelector('.etv-image .et-cross').getAttribute('style')"
    page.wait_for_function(f"(at) => {where} !== at", arg=at)
    page.get_by_role("slider", name="Time").focus()
    now = page.get_by_role("slider", name="Time").get_attribute("aria-valuenow")
    page.wait_for_timeout(100)
    page.keyboard.press("ArrowRight")
    then = "document.querySelector('.etv-track').getAttribute('aria-valuenow')"
    page.wait_for_function(f"(now) => {then} !== now", arg=now)
    close(page)


GAMEPAD = """() => {
  const buttons = Array.from({ length: 16 }, () => ({ pressed: false }));
  window.pad = { axes: [0, 0, 0, 0], buttons };
  Object.defineProperty(navigator, 'getGamepads', { value: () => [null, window.pad] });
}"""
SPOT = """() => {
  const ring = document.querySelector('.etv-image .et-cross');
  return ring && document.querySelector('[data-testid=yours]')
    ? ['--u', '--v'].map((name) => Number(ring.style.getPropertyValue(name))) : null;
}"""


def test_a_gamepad_moves_the_spot_plays_and_goes_back_to_the_events(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720, lambda page: page.add_init_script(f"({GAMEPAD})()"))
    moved = f"([axis, way, from]) => {{ const at = ({SPOT})(); return at && way * (at[axis] - from) > 0.01; }}"
    page.evaluate("() => { window.pad.axes[0] = 0.9; }")
    page.wait_for_function(SPOT)
    page.evaluate("() => { window.pad.axes[0] = 0; }")
    page.get_by_test_id("map").wait_for()
    for axis, way, push, rest in (
        (0, -1, "window.pad.axes[0] = -0.9", "window.pad.axes[0] = 0"),
        (1, 1, "window.pad.buttons[13].pressed = true", "window.pad.buttons[13].pressed = false"),
    ):
        at = page.evaluate(SPOT)
        page.evaluate(f"() => {{ {push}; }}")
        page.wait_for_function(moved, arg=[axis, way, at[axis]])
        page.evaluate(f"() => {{ {rest}; }}")
    for number, answer in ((0, page.get_by_role("button", name="Pause")), (1, page.locator("[data-large=cloud]"))):
        page.evaluate("(number) => { window.pad.buttons[number].pressed = true; }", number)
        answer.first.wait_for()
        page.evaluate("(number) => { window.pad.buttons[number].pressed = false; }", number)
    close(page)


def test_a_group_guesses_before_it_sees_the_image(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    page.wait_for_function("() => window.__viserMutable?.cameraControl")
    stood = at_rest(page, "() => window.__viserMutable.cameraControl.azimuthAngle")
    turned = "(stood) => Math.abs(window.__viserMutable.cameraControl.azimuthAngle - stood)"
    press(page, "Guess first")
    page.locator(".etv-veiled").first.wait_for()
    page.wait_for_function(f"(stood) => ({turned})(stood) > 0.3", arg=stood)
    assert page.evaluate("() => getComputedStyle(document.querySelector('.etv-veiled .et-picture')).opacity") == "0"
    press(page, "Show the image")
    page.locator(".etv-unveiled").first.wait_for()
    page.wait_for_function(f"(stood) => ({turned})(stood) < 0.01", arg=stood)
    close(page)
