"""A video is dropped on the page and seen as an event camera would have; a slider asks for another camera."""

import base64

import pytest

from app.config import ViewerConfig
from app.main import Viewer
from tests.browser.chromium import open_page, until_window
from tests.simulation.films import drifting, write_film


@pytest.fixture(scope="module")
def viewer(browser):
    running = Viewer(ViewerConfig(port=0, precision="fp32", budget=128, threads=1, uploads=4))
    yield running
    running.stop()


def drop(page, path):
    data = page.evaluate_handle(
        """content => {
            const data = new DataTransfer();
            const bytes = Uint8Array.from(atob(content), sign => sign.charCodeAt(0));
            data.items.add(new File([bytes], "holiday.mp4"));
            return data;
        }""",
        base64.b64encode(path.read_bytes()).decode(),
    )
    page.dispatch_event("body", "dragover", {"dataTransfer": data})
    page.dispatch_event("body", "drop", {"dataTransfer": data})


def test_a_dropped_video_is_seen_reconstructed_and_scored_and_a_slider_makes_another_film_of_it(
    browser, viewer, tmp_path
):
    page = open_page(browser, viewer.url)
    drop(page, write_film(tmp_path / "a.mp4", drifting(9, 2.0)))
    page.get_by_test_id("film").get_by_text("all of its 0.3 s are there").wait_for()
    until_window(page, 0)
    page.get_by_test_id("film-strip").wait_for()
    slider = page.get_by_role("slider").first
    slider.focus()
    slider.press("ArrowRight")
    page.locator("[data-testid=film-choices] .etv-on[data-k*='~0.25~0.20~']").first.wait_for()
    page.get_by_test_id("film").get_by_text("all of its 0.3 s are there").wait_for()
    page.get_by_test_id("window").get_by_text("window 0 of 0 – 7").wait_for()
    assert page.errors == []
    page.context.close()
