"""A booth that cannot be broken: nothing of viser's own is in reach, and what one visitor left is gone for the next."""

import time
import urllib.request

import pytest

from app.config import ViewerConfig
from app.main import Viewer
from app.session import demo as script
from tests.browser.chromium import PATIENCE, box_of
from tests.browser.conftest import ROI

OURS = ".etv-demo, .etv-demo-bar, .etv-bar, .etv-card, .etv-tour, .mantine-Modal-content:has(.etv-help)"
REACHED = """(ours) => {
  const wanted = 'button, input, select, textarea, a[href], summary, [role=button], [role=tab], [role=slider],'
    + '[tabindex="0"], [data-dock-griphandle], [data-dock-strip], [data-dock-minimize], [data-dock-resize],'
    + '.mantine-Burger-root';
  const found = [];
  for (const element of document.querySelectorAll(wanted)) {
    if (element.closest(ours) || !element.checkVisibility()) continue;
    const box = element.getBoundingClientRect();
    if (box.width < 2 || box.height < 2) continue;
    const on = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);
    const isOn = on && on !== document.body && (element.contains(on) || on.contains(element));
    if (isOn) found.push(element.outerHTML.slice(0, 200));
  }
  return found;
}"""
SMALL = """() => [...document.querySelectorAll('.etv-demo button, .etv-demo-bar button, .etv-track')]
  .filter((element) => element.checkVisibility())
  .map((element) => [element.getBoundingClientRect(), element.outerHTML.slice(0, 120)])
  .filter(([box]) => box.width < 44 || box.height < 44 || box.left < 0 || box.right > innerWidth
    || box.bottom > innerHeight + 1)
  .map(([box, html]) => `${Math.round(box.width)}x${Math.round(box.height)} ${html}`)"""


def serve(**options):
    return Viewer(ViewerConfig(demo=True, budget=256, threads=1, roi=",".join(map(str, ROI)), **{"port": 0, **options}))


@pytest.fixture(scope="module")
def demo(browser):
    viewer = serve()
    viewer.rehearse()
    yield viewer
    viewer.stop()


@pytest.fixture
def stays(monkeypatch):
    """The page stays with its visitor until this is called; then nobody has touched it for long enough."""
    monkeypatch.setattr(script, "IDLE", 1e9)
    return lambda: monkeypatch.setattr(script, "IDLE", 1.0)


def open_demo(browser, viewer, width=1600, height=900, prepare=lambda page: None):
    phone = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2} if width < 500 else {}
    context = browser.new_context(viewport={"width": width, "height": height}, permissions=["camera"], **phone)
    page = context.new_page()
    page.set_default_timeout(PATIENCE)
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    prepare(page)
    page.goto(f"{viewer.url}/?fixedDpr=1", wait_until="commit")
    page.locator(".etv-image img").wait_for()
    return page


def touch(page):
    """A finger on the image: its HTML is replaced with each new frame, so it is aimed at and not waited for."""
    box = box_of(page, page.locator(".etv-image .etv-frame"))
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def press(page, name):
    """A finger on a button: what is drawn twelve times a second never rests, so it is aimed at and not waited for."""
    box = box_of(page, page.get_by_role("button", name=name))
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)


def close(page):
    assert page.errors == []
    page.context.close()


@pytest.mark.parametrize("size", [(1600, 900), (1280, 720), (390, 844), (360, 640)])
def test_nothing_of_visers_own_is_in_reach(browser, demo, stays, size):
    page = open_demo(browser, demo, *size)
    page.wait_for_timeout(1000)
    assert page.evaluate(REACHED, OURS) == []
    assert page.evaluate(SMALL) == []
    touch(page)
    page.get_by_test_id("map").wait_for()
    assert page.evaluate(REACHED, OURS) == []
    page.keyboard.press("Control+k")
    page.wait_for_timeout(400)
    assert (
        page.get_by_placeholder("Search commands").count() == 0
        or not page.get_by_placeholder("Search commands").is_visible()
    )
    close(page)


@pytest.mark.parametrize("size", [(1600, 900), (390, 844)])
def test_when_a_visitor_has_gone_the_page_is_loaded_anew_and_nothing_of_theirs_is_left(browser, demo, stays, size):
    page = open_demo(browser, demo, *size)
    page.get_by_test_id("invitation").wait_for()
    touch(page)
    page.get_by_test_id("yours").wait_for()
    page.evaluate("() => { window.left = 'by a visitor'; localStorage.setItem('left', 'x'); }")
    page.keyboard.type("?")
    page.get_by_text("Show me around").wait_for()
    stays()
    page.wait_for_function("() => window.left === undefined")
    page.get_by_test_id("invitation").wait_for()
    assert page.get_by_text("Show me around").count() == 0
    assert page.locator(".etv-image .et-cross").count() == 0
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


def test_a_lost_connection_is_waited_for_with_a_sentence(browser, stays):
    viewer = serve()
    port = viewer.port
    page = open_demo(browser, viewer, 1280, 720)
    viewer.stop()
    page.get_by_test_id("lost").get_by_text("The show goes on in a moment").wait_for()
    again = serve(port=port)
    try:
        page.get_by_test_id("lost").wait_for(state="detached")
        page.locator(".etv-image img").wait_for()
        page.context.close()
    finally:
        again.stop()


def test_a_visitor_sees_their_own_camera_as_a_sensor_does(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    press(page, "Your own face")
    page.get_by_text("Nothing is stored").wait_for()
    press(page, "Use my camera")
    page.get_by_test_id("mirror").wait_for()
    page.get_by_test_id("delay").wait_for()
    assert "simulated event sensor" in page.get_by_test_id("yours").inner_text()
    page.locator("[data-etv-mirror=contrast]").fill("0.9")
    assert page.evaluate(REACHED, OURS) == []
    shown = "() => document.querySelector('.etv-image img')?.alt"
    first = page.evaluate(shown)
    page.wait_for_function(f"(first) => ({shown})() !== first", arg=first)
    press(page, "Stop the camera")
    page.get_by_test_id("mirror").wait_for(state="detached")
    page.locator(".etv-image img").wait_for()
    assert page.locator("video").count() == 0
    close(page)


def test_three_seconds_are_taken_home_as_a_page(browser, demo, stays):
    page = open_demo(browser, demo, 1280, 720)
    press(page, "Take it home")
    link = page.get_by_test_id("home-link")
    link.wait_for(timeout=2 * PATIENCE)
    address = f"{demo.url}{link.get_attribute('href')}"
    with urllib.request.urlopen(address, timeout=10) as answer:
        assert answer.headers["Content-Security-Policy"].startswith("sandbox")
        assert b"page-facts" in answer.read()
    taken = page.context.new_page()
    troubles = []
    taken.on("pageerror", lambda error: troubles.append(str(error)))
    taken.goto(address)
    taken.locator("html[data-shown]").wait_for()
    assert troubles == []
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
    stood = page.evaluate("() => window.__viserMutable.cameraControl.azimuthAngle")
    turned = "(stood) => Math.abs(window.__viserMutable.cameraControl.azimuthAngle - stood)"
    press(page, "Guess first")
    page.locator(".etv-veiled").first.wait_for()
    page.wait_for_function(f"(stood) => ({turned})(stood) > 0.3", arg=stood)
    assert page.evaluate("() => getComputedStyle(document.querySelector('.etv-veiled .et-picture')).opacity") == "0"
    press(page, "Show the image")
    page.locator(".etv-unveiled").first.wait_for()
    page.wait_for_function(f"(stood) => ({turned})(stood) < 0.01", arg=stood)
    close(page)


def test_on_a_phone_the_help_speaks_of_touch_and_the_tour_points_at_what_is_there(browser, demo, stays):
    page = open_demo(browser, demo, 390, 844)
    page.get_by_role("button", name="Help").tap()
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
