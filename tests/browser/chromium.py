"""A headless Chromium with software WebGL, and how to tell that a page of the viewer is there."""

import os
import re
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = [
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-default-apps",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--use-fake-device-for-media-stream",
    "--use-fake-ui-for-media-stream",
]
WORKSPACES = ("inspect", "attention", "compare", "recording", "demo")
"""In the order of the keys 1 … 5."""
PLAY, PAUSE = re.compile("^Play( |$)"), re.compile("^Pause( |$)")
"""Names of the button that plays."""
PATIENCE = 120_000
"""Milliseconds: two cores render the page, run the network and draw the scene in software."""


def executable() -> str | None:
    """The browser that is installed here."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


def require_browser() -> str:
    """The browser, or a skipped test; with CI=true its absence is a failure."""
    path = executable()
    if path is not None:
        return path
    if os.environ.get("CI") == "true":
        pytest.fail("no Chromium here, and CI=true: install it with `apt-get install chromium`")
    pytest.skip("no Chromium on this machine (apt-get install chromium)")


@contextmanager
def chromium(path: str) -> Iterator:
    """A running browser."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, headless=True, args=FLAGS)
        try:
            yield browser
        finally:
            browser.close()


def open_page(browser, url, width=1280, height=720, context=None, patience=PATIENCE):
    """A page on the viewer, once it shows a moment. A phone below 500 pixels of width."""
    if context is None:
        phone = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2} if width < 500 else {}
        context = browser.new_context(viewport={"width": width, "height": height}, **phone)
        context.add_init_script("localStorage.setItem('etnet-tour', 'seen')")
    page = context.new_page()
    page.set_default_timeout(patience)
    page.patience = patience
    page.errors = []
    page.on("pageerror", lambda error: page.errors.append(str(error)))
    page.goto(f"{url}{'&' if '?' in url else '/?'}fixedDpr=1")
    page.get_by_test_id("timeline").wait_for()
    dismiss_notices(page)
    return page


def dismiss_notices(page):
    """Close notices: viser says that WebGL is software here."""
    page.evaluate("() => document.querySelectorAll('.mantine-Notification-closeButton').forEach(x => x.click())")


def open_workspace(page, name):
    """Go to a workspace by its key, and wait until the page is there."""
    page.locator("body").press(str(WORKSPACES.index(name) + 1))
    page.locator(f"[data-etv-workspace={name}]").wait_for(state="attached")


def open_tab(page, name):
    """Open a tab of the inspector column."""
    tab = page.locator(f".etv-tabs [data-k='tab:{name}']")
    tab.click()
    page.locator(f".etv-tabs [data-k='tab:{name}'][aria-pressed=true]").wait_for()


def press(page, key):
    """Click what sends `key` (`data-k`)."""
    page.locator(f"[data-k='{key}']:visible").first.click()


def until_window(page, index):
    """Wait until a window is on show and its reconstruction has come."""
    page.get_by_alt_text(f"Reconstruction of window {index}", exact=True).first.wait_for()
    page.get_by_test_id("lag").first.wait_for(state="hidden")


def at_rest(page, script, seconds=1.5):
    """What a script gives once it has been the same for so long: viser moves columns and canvas after a page is up."""
    held, since, ends = page.evaluate(script), time.monotonic(), time.monotonic() + PATIENCE / 1000
    while time.monotonic() - since < seconds:
        assert time.monotonic() < ends, f"never at rest: {script[:60]}"
        page.wait_for_timeout(100)
        if (now := page.evaluate(script)) != held:
            held, since = now, time.monotonic()
    return held


def box_of(page, locator):
    """The box of `locator`'s first element: asked again while the page is just replacing it."""
    for _ in range(100):
        if (box := locator.first.bounding_box()) is not None:
            return box
        page.wait_for_timeout(50)
    raise AssertionError(f"{locator} has no box for five seconds")
