"""One browser and one viewer for all browser tests: the default network on a small region of a bundled recording."""

import pytest

from tests.browser.chromium import chromium, open_page, require_browser

ROI = (86, 60, 60, 44)
"""x, y, width, height: no multiple of 8, so that the outer tokens lie half on padding."""


def pytest_collection_modifyitems(items):
    for item in items:
        if "tests/browser" in str(item.path):
            item.add_marker(pytest.mark.browser)


@pytest.fixture(scope="session")
def browser():
    with chromium(require_browser()) as running:
        yield running


@pytest.fixture(scope="session")
def viewer(browser):
    from app.config import ViewerConfig
    from app.main import Viewer

    running = Viewer(ViewerConfig(port=0, precision="fp32", budget=256, threads=1, roi=",".join(map(str, ROI))))
    yield running
    running.stop()


@pytest.fixture
def page(browser, viewer):
    """A visitor's page; any error in it fails the test."""
    opened = open_page(browser, viewer.url)
    yield opened
    assert opened.errors == []
    opened.context.close()
