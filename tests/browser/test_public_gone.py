"""Nothing that a visitor of the demo did survives them: they go, their socket is lost, the server is started anew."""

import json

import pytest

from etnet.events.write import write_recording
from tests.app.stand_ins import held_files, recording
from tests.browser.booth import OURS, REACHED, close, open_demo, press, serve, touch
from tests.browser.chromium import at_rest

DESKTOP, PHONE = (1280, 720), (390, 844)
SIZES = [DESKTOP, PHONE]
STANDING = """() => {
  const box = (element) => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return [left, top, width, height].map(Math.round).join();
  };
  const windows = '.mantine-Modal-content, .etv-tour, .etv-sheet:not([hidden]), .mantine-Spotlight-content';
  const nodes = window.__viserMutable.nodeRefFromName;
  return {
    canvas: box(document.querySelector('canvas[data-engine]')),
    figures: [...document.querySelectorAll('.etv-figure, .etv-demo-bar')].map(box).join(' '),
    windows: [...document.querySelectorAll(windows)].filter((element) => element.checkVisibility()).length,
    hidden: Object.entries(nodes).filter(([name, node]) => node && !node.visible).map(([name]) => name).join(),
    turned: window.__viserMutable.cameraControl.azimuthAngle.toFixed(2),
    local: Object.keys(localStorage).sort().join(),
    session: Object.keys(sessionStorage).sort().join(),
    address: location.search,
    act: document.querySelector('.etv-demo').dataset.act,
    spots: document.querySelectorAll('.etv-image .et-cross').length,
  };
}"""
"""How a page stands in an act, apart from what it plays."""
VISERS = (
    "[data-dock-minimize], [data-dock-region-collapse], [data-testid='floating-panel-handle'], .mantine-Burger-root"
)
COLLAPSE = """(parts) => {
  for (const part of document.querySelectorAll(parts)) part.click();
}"""
DRAG = """() => {
  for (const grip of document.querySelectorAll('[data-dock-griphandle], [data-testid="floating-panel-handle"]')) {
    const hand = { bubbles: true, pointerId: 1, button: 0 };
    const at = (type, x, y) => new PointerEvent(type, { clientX: x, clientY: y, ...hand });
    grip.dispatchEvent(at('pointerdown', 5, 5));
    document.dispatchEvent(at('pointermove', 200, 200));
    document.dispatchEvent(at('pointermove', 400, 300));
    document.dispatchEvent(at('pointerup', 400, 300));
  }
}"""
MENUS = """(ours) => {
  window.showSaveFilePicker = () => new Promise(() => {});
  for (const button of document.querySelectorAll('button, [role=button], [role=tab]')) {
    if (!button.closest(ours)) button.click();
  }
}"""
"""viser's own buttons, though none of them can be reached by hand."""
HIDE = """() => {
  for (const node of Object.values(window.__viserMutable.nodeRefFromName)) if (node) node.visible = false;
}"""
KEEP = """() => {
  localStorage.setItem('left', 'x');
  sessionStorage.setItem('left', 'x');
  history.replaceState(null, '', location.search + '&moment=bm90aGluZw');
}"""


def help_and_tour(page):
    page.keyboard.type("?")
    page.get_by_text("Show me around").click()
    page.get_by_test_id("tour").wait_for()


def look_into_the_mirror(page):
    press(page, "Your own face")
    press(page, "Use my camera")
    page.get_by_test_id("delay").wait_for()
    press(page, "Stop the camera")
    page.get_by_test_id("mirror").wait_for(state="hidden")


ACTS = {
    "touch": lambda page: page.get_by_test_id("map").wait_for(),
    "collapse": lambda page: page.evaluate(COLLAPSE, VISERS),
    "drag a panel out": lambda page: page.evaluate(DRAG),
    "open the menus": lambda page: (page.keyboard.press("Control+k"), page.evaluate(MENUS, OURS)),
    "turn the camera": lambda page: page.evaluate("() => window.__viserMutable.cameraControl.rotate(1.2, 0.4, false)"),
    "hide nodes": lambda page: page.evaluate(HIDE),
    "keep something": lambda page: page.evaluate(KEEP),
    "help and tour": help_and_tour,
    "guess": lambda page: (press(page, "Guess first"), page.locator(".etv-veiled").first.wait_for()),
    "mirror": look_into_the_mirror,
}


@pytest.fixture(scope="module")
def demo(browser):
    viewer = serve(uploads=1)
    viewer.rehearse()
    yield viewer
    viewer.stop()


def visited(page):
    """The page of a visitor who has touched it, and how it stood before."""
    page.get_by_test_id("invitation").wait_for()
    page.locator(".etv-demo[data-act=events]").wait_for()
    page.wait_for_function("() => window.__viserMutable?.cameraControl")
    before = at_rest(page, STANDING)
    touch(page)
    page.get_by_test_id("yours").wait_for()
    page.evaluate("() => { window.left = 'by a visitor'; }")
    return before


def until_anew(page, before):
    """The show has begun again, on a page that was loaded anew and stands as it stood."""
    page.wait_for_function("() => window.left === undefined && window.__viserMutable?.cameraControl")
    page.get_by_test_id("invitation").wait_for()
    page.locator(".etv-image img").wait_for()
    page.wait_for_function(
        f"(before) => {{ const now = JSON.stringify(({STANDING})()); window.stands = now; return now === before; }}",
        arg=json.dumps(before, separators=(",", ":")),
    )
    assert page.evaluate(REACHED, OURS) == []


QUICK = ("touch", "keep something")
"""Acts that every run tries; the others, which all wait for the same end, are tried with the slow tests."""


@pytest.mark.parametrize("act", [act if act in QUICK else pytest.param(act, marks=pytest.mark.slow) for act in ACTS])
def test_when_a_visitor_has_gone_the_page_is_loaded_anew_and_nothing_of_theirs_is_left(browser, demo, stays, act):
    page = open_demo(browser, demo, *DESKTOP)
    before = visited(page)
    ACTS[act](page)
    stays()
    until_anew(page, before)
    close(page)


def test_a_file_that_was_handed_over_is_gone_with_its_visitor(browser, demo, stays, tmp_path):
    write_recording(recording("mine"), tmp_path / "mine.h5")
    page = open_demo(browser, demo, *DESKTOP)
    before = visited(page)
    press(page, "Your own face")
    with page.expect_file_chooser() as chooser:
        press(page, "Your own video")
    chooser.value.set_files(tmp_path / "mine.h5")
    page.get_by_role("button", name="Another scene").wait_for()
    page.wait_for_function("() => !document.querySelector('.etv-sheet:not([hidden])')")
    page.locator(".etv-image img").wait_for()
    assert held_files(demo.uploads)
    stays()
    until_anew(page, before)
    assert held_files(demo.uploads) == []
    assert demo.catalogue._private == {}
    close(page)


@pytest.mark.parametrize("size", SIZES, ids=["desktop", "phone"])
def test_a_socket_that_is_cut_is_followed_by_the_show_and_nothing_of_the_visitors(browser, demo, stays, size):
    page = open_demo(browser, demo, *size)
    before = visited(page)
    demo.server._websock_server.disconnect_all_clients()
    until_anew(page, before)
    close(page)


def test_a_lost_connection_is_waited_for_with_a_sentence(browser, stays):
    viewer = serve()
    port = viewer.port
    page = open_demo(browser, viewer, *DESKTOP)
    viewer.stop()
    page.get_by_test_id("lost").get_by_text("The show goes on in a moment").wait_for()
    again = serve(port=port)
    try:
        page.get_by_test_id("lost").wait_for(state="detached")
        page.locator(".etv-image img").wait_for()
        page.context.close()
    finally:
        again.stop()
