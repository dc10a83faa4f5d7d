"""A live source in a real browser: followed, left for the past, pinned there and held against the present, recorded."""

import re

import pytest

from tests.browser.chromium import box_of, open_page, open_workspace, until_window


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    """A viewer of a replayed recording that is binned, so that two cores keep up."""
    from app.config import LiveConfig, ViewerConfig
    from app.main import Viewer
    from etnet.bundled import samples

    folder = tmp_path_factory.mktemp("recorded")
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(folder)
        source = LiveConfig(loop=True, keep="600s")
        running = Viewer(
            ViewerConfig(port=0, threads=1, budget=256, downsample=4, live=str(samples()[0]), source=source)
        )
        yield running, folder
        running.stop()


def _window(page):
    return int(re.search(r"window ([\d,]+)", page.get_by_test_id("window").inner_text())[1].replace(",", ""))


def _until_window(page, index):
    """The line of numbers is replaced with each window: it is read until it says at least this one."""
    page.wait_for_function(
        """index => Number(/window ([\\d,]+)/.exec(document.querySelector("[data-testid=window]")?.innerText ?? "")?.[1]
          .replaceAll(",", "") ?? -1) >= index""",
        arg=index,
    )


def _until_held_against_the_pin(page, index):
    """A − B shows the present, at least this window, and the pinned window 0 below it."""
    page.wait_for_function(
        """index => {
          const words = [...document.querySelectorAll(".et-frames-below figcaption")].map(each => each.innerText);
          const of = which => Number(/window ([\\d,]+)/.exec(words.find(each => each.startsWith(which)) ?? "")?.[1]
            .replaceAll(",", "") ?? -1);
          return of("now") >= index && of("then") === 0;
        }""",
        arg=index,
    )


def _press(page, key):
    """Press what sends `key`: its HTML is replaced all the time, so that no place of it is waited for."""
    page.locator(f"[data-k='{key}']").first.dispatch_event("pointerdown")


def test_live_left_for_the_past_asked_pinned_compared_with_now_recorded_and_opened(browser, live):
    viewer, folder = live
    page = open_page(browser, viewer.url, patience=150_000)  # the network gets ready first
    page.get_by_test_id("is-live").wait_for()
    page.get_by_test_id("chip-live").filter(has_text="behind").first.wait_for()
    page.get_by_test_id("chip-exact").first.wait_for()
    _until_window(page, 8)

    strip = box_of(page, page.get_by_test_id("strip"))
    y = strip["y"] + strip["height"] / 3
    page.mouse.move(strip["x"] + strip["width"] * 0.95, y)
    page.mouse.down()
    page.mouse.move(strip["x"] + 1, y, steps=6)
    page.mouse.up()
    page.get_by_role("button", name="Back to live").wait_for()
    page.get_by_test_id("chip-plain").filter(has_text="ago").first.wait_for()
    until_window(page, 0)
    image = box_of(page, page.get_by_alt_text("Reconstruction of window 0", exact=True))
    page.mouse.click(image["x"] + image["width"] / 2, image["y"] + image["height"] / 2)
    page.get_by_test_id("query").first.wait_for()
    open_workspace(page, "attention")
    page.get_by_test_id("peak").wait_for()
    open_workspace(page, "inspect")
    assert _window(page) == 0

    open_workspace(page, "attention")
    _press(page, "attention:pin:a")
    page.get_by_test_id("a-minus-b").filter(has_text="share 100 %").wait_for()
    _press(page, "live:follow")
    page.get_by_test_id("is-live").wait_for()
    _until_window(page, 8)
    _until_held_against_the_pin(page, 8)
    assert page.get_by_test_id("pinned").filter(has_text="window 0").count() == 1
    open_workspace(page, "inspect")
    page.get_by_test_id("is-live").wait_for()

    _press(page, "live:record")
    page.get_by_role("button", name="Stop recording").first.wait_for()
    _until_window(page, _window(page) + 4)
    _press(page, "live:stop")
    page.get_by_role("button", name="Open it").wait_for()
    (recorded,) = folder.glob("live-*.aedat4")
    _press(page, f"open:{viewer.live.files()[0].id}")
    page.get_by_role("button", name="Show live").wait_for()
    page.locator(".etv-recordings summary").get_by_text(recorded.name).wait_for()
    page.get_by_alt_text("Reconstruction of window 0", exact=True).first.wait_for()
    assert page.errors == []
    page.context.close()
