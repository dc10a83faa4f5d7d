"""The example of docs/own_view.md as a tab of the page, and a view of one's own that raises."""

import re
from pathlib import Path

import pytest

from tests.browser.chromium import open_page, until_window

DOCS = Path(__file__).parents[2] / "docs" / "own_view.md"
RAISES = """title = "Broken"


def show(moment):
    sensor = moment.recording.sensor
    return 1 / (sensor.width - sensor.width)
"""


@pytest.fixture(scope="module")
def own_viewer(browser, tmp_path_factory):
    from app.config import ViewerConfig
    from app.main import Viewer

    folder = tmp_path_factory.mktemp("own")
    example = re.search(r"```python\n(# my_view\.py\n.*?)```", DOCS.read_text("utf-8"), re.DOTALL)
    assert example is not None
    mine, broken = folder / "my_view.py", folder / "broken.py"
    mine.write_text(example[1], "utf-8")
    broken.write_text(RAISES, "utf-8")
    running = Viewer(ViewerConfig(port=0, budget=256, threads=1, roi="96,0,48,180", views=(mine, broken)))
    yield running
    running.stop()


def test_the_example_of_the_docs_shows_its_plot_and_follows_its_widgets(browser, own_viewer):
    page = open_page(browser, own_viewer.url)
    page.get_by_role("button", name="Row profile", exact=True).click()
    plot = page.get_by_test_id("own").locator(".et-curve svg")
    plot.wait_for()
    lines = plot.locator("polyline")
    page.get_by_test_id("own").get_by_text("network").wait_for()
    assert lines.count() == 2
    assert page.get_by_test_id("own").get_by_text("camera", exact=True).is_visible()
    before = lines.first.get_attribute("points")
    page.get_by_text("Smooth", exact=True).first.wait_for()
    page.locator("[data-dock-region=right]").get_by_role("checkbox").first.check()
    page.wait_for_function(
        "before => document.querySelector('[data-testid=own] polyline')?.getAttribute('points') !== before", arg=before
    )
    assert page.errors == []
    page.context.close()


def test_a_view_that_raises_shows_its_file_and_line_and_nothing_else_ends(browser, own_viewer):
    page = open_page(browser, own_viewer.url)
    page.get_by_role("button", name="Broken", exact=True).click()
    failed = page.get_by_test_id("own-failed")
    failed.wait_for()
    assert "broken.py, line 6: ZeroDivisionError" in failed.inner_text()
    page.get_by_text("return 1 / (sensor.width - sensor.width)").wait_for()
    page.locator("body").press("Home")
    page.locator("body").press("l")
    until_window(page, 1)
    page.get_by_role("button", name="Row profile", exact=True).click()
    page.get_by_test_id("own").locator(".et-curve svg").wait_for()
    assert page.errors == []
    page.context.close()
