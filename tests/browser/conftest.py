"""One browser and one viewer for all browser tests: the default network on a small region of a bundled recording.

A page of the viewer takes seconds to come up, so the tests of one file share one, and each begins at its first window.
"""

import pytest
from playwright.sync_api import Error as BrowserError
from playwright.sync_api import expect

from tests.browser.chromium import PATIENCE, chromium, open_page, open_workspace, require_browser
from tests.browser.faults import SCENE

expect.set_options(timeout=PATIENCE)

ROI = (86, 60, 60, 44)
"""x, y, width, height: no multiple of 8, so that the outer tokens lie half on padding."""
SIZE = (1280, 720)


def pytest_collection_modifyitems(items):
    for item in items:
        if "tests/browser" in str(item.path):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="package")
def browser():
    with chromium(require_browser()) as running:
        yield running


@pytest.fixture(scope="package")
def viewer(browser):
    from app.config import ViewerConfig
    from app.main import Viewer

    running = Viewer(ViewerConfig(port=0, precision="fp32", budget=256, threads=1, roi=",".join(map(str, ROI))))
    yield running
    running.stop()


@pytest.fixture(scope="module")
def demo(browser):
    """A demo whose first scene is rendered."""
    from tests.browser.booth import serve

    running = serve()
    running.rehearse()
    yield running
    running.stop()


@pytest.fixture
def stays(monkeypatch):
    """The demo's page stays with its visitor until this is called; then nobody has touched it for long enough."""
    from app.session import demo as script

    monkeypatch.setattr(script, "IDLE", 1e9)
    return lambda: monkeypatch.setattr(script, "IDLE", 1.0)


@pytest.fixture(scope="module")
def shared_pages(browser, viewer):
    """The page of a file's tests, once one of them has asked for it."""
    opened = []
    yield opened
    for page in opened:
        page.context.close()


@pytest.fixture
def page(browser, viewer, shared_pages):
    """A visitor's page in the workspace *Inspect*, at the first window; any error in it fails the test."""
    if not shared_pages or not _begins_again(shared_pages[0]):
        for broken in shared_pages:
            broken.context.close()
        shared_pages[:] = [open_page(browser, viewer.url, *SIZE)]
    page = shared_pages[0]
    page.errors.clear()
    yield page
    assert page.errors == []


def _begins_again(page):
    """Bring a page back to its beginning; what a failed test left open may be in the way."""
    try:
        page.set_default_timeout(10_000)
        page.set_viewport_size({"width": SIZE[0], "height": SIZE[1]})
        page.locator("body").press("Escape")
        open_workspace(page, "inspect")
        page.locator("body").press("Home")
        page.get_by_test_id("window").get_by_text("window 0 of").wait_for()
        page.wait_for_function(SCENE)
    except BrowserError:
        return False
    page.set_default_timeout(page.patience)
    return True
