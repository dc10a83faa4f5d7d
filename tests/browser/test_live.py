"""A live source in a real browser: followed, left for the past, returned to, recorded, and the file opened."""

import re

import pytest

from tests.browser.chromium import box_of, open_page

IMAGE = re.compile("^Reconstruction of window")


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A viewer of a replayed recording that is binned, so that two cores keep up."""
    from app.config import LiveConfig, ViewerConfig
    from app.main import Viewer
    from etnet.bundled import samples

    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        source = LiveConfig(loop=True)
        running = Viewer(
            ViewerConfig(port=0, threads=1, budget=256, downsample=4, live=str(samples()[0]), source=source)
        )
        yield running, folder
        running.stop()


def _window(page):
    return int(re.search(r"window ([\d,]+)", page.get_by_test_id("window").inner_text())[1].replace(",", ""))


@pytest.mark.xfail(reason="seen to hold by hand; its waits are too short on a busy machine", strict=False)
def test_live_left_for_the_past_asked_returned_to_recorded_and_opened(browser, live):
    viewer, folder = live
    page = open_page(browser, viewer.url, patience=150_000)  # the network gets ready first
    page.get_by_test_id("is-live").wait_for()
    page.get_by_test_id("chip-live").first.get_by_text("behind").wait_for()
    page.get_by_test_id("chip-exact").first.wait_for()
    page.wait_for_timeout(3000)

    newest = _window(page)
    strip = box_of(page, page.get_by_test_id("strip"))
    y = strip["y"] + strip["height"] / 3
    page.mouse.move(strip["x"] + strip["width"] * 0.95, y)
    page.mouse.down()
    page.mouse.move(strip["x"] + strip["width"] * 0.4, y, steps=6)
    page.mouse.up()
    page.get_by_role("button", name="Back to live").wait_for()
    page.get_by_test_id("chip-plain").get_by_text("ago").first.wait_for()
    left_at = _window(page)
    assert left_at < newest
    image = box_of(page, page.get_by_alt_text(IMAGE))
    page.mouse.click(image["x"] + image["width"] / 2, image["y"] + image["height"] / 2)
    page.get_by_test_id("query").first.wait_for()
    page.locator("body").press("2")
    page.get_by_text(re.compile("peak: token")).first.wait_for()
    page.locator("body").press("1")
    assert _window(page) == left_at

    page.get_by_role("button", name="Back to live").click()
    page.get_by_test_id("is-live").wait_for()
    assert _window(page) > newest

    page.get_by_role("button", name="Record", exact=True).first.click()
    page.get_by_role("button", name="Stop recording").first.wait_for()
    page.wait_for_timeout(2500)
    page.get_by_role("button", name="Stop recording").first.click()
    page.get_by_role("button", name="Open it").click()
    page.get_by_role("button", name="Show live").wait_for()
    (recorded,) = folder.glob("live-*.aedat4")
    page.locator(".etv-recordings summary").get_by_text(recorded.name).wait_for()
    page.get_by_alt_text("Reconstruction of window 0", exact=True).first.wait_for()
    assert page.errors == []
    page.context.close()
